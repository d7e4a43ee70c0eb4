#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "api/kit/message.hpp"

namespace anchord::api {

/// Answer to a body of many rows: 200 with what became of them. Where not one was taken it is 422, a problem
/// that has the same members beside its own: who reads only the status is not told that all is well.
Response row_report(const nlohmann::ordered_json& report, bool none_taken, const std::string& why);

}  // namespace anchord::api
