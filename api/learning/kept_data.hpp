#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "api/learning/dataset_table.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

/// Rows this server keeps that can judge a model.
struct KeptData {
  DatasetTable table;              ///< every row counts as held out
  std::vector<std::string> names;  ///< of the data sets they are of
};

/// Held-out places of every frozen data set (the newest 20, at most 50 000 rows), and all rows of one that
/// has none held out, unless a model to be judged was trained on that very data: its digest is in `learned`.
/// Whose rows the model's task or features cannot use are left out when it is measured.
Result<KeptData> kept_data(DatasetStore& datasets, std::span<const std::string> learned);

/// The data set of this digest, whatever its name; nothing where none is kept.
Result<std::optional<DatasetTable>> table_of_digest(DatasetStore& datasets, std::string_view digest);

}  // namespace anchord::api
