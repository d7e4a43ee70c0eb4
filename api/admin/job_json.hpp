#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string_view>

#include "core/ports/job_store.hpp"

namespace anchord::api {

nlohmann::ordered_json job_json(const Job& job);

}  // namespace anchord::api
