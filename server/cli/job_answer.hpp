#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/base/result.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {

/// Waits for what a request began, longer than one answer does. The body of the answer; null where it was not
/// there in time and its job has succeeded since. errors: link_lost; unsupported, with the server's words
Result<nlohmann::ordered_json> answer_of_job(server::HttpClient& client, const std::string& target,
                                             const std::string& body = {});

}  // namespace anchord::cli
