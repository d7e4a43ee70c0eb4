#pragma once

#include <string_view>

#include "core/ports/learning_store.hpp"
#include "server/storage/sql.hpp"

/// Rows of the table `model`, which models and training runs both write.
namespace anchord::sql {

void insert_model(Connection& connection, const StoredModel& model, std::string_view artifact);

}  // namespace anchord::sql
