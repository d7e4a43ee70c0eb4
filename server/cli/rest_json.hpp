#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "server/cli/rest_client.hpp"

/// JSON over the client, for commands that follow what a running server answers.
namespace anchord::cli {

/// errors  those of the client; invalid_argument: the answer is no JSON object
Result<nlohmann::json> get_json(RestClient& client, const std::string& path);

/// Sends a creation that a repeated request does not make twice.
Result<nlohmann::json> post_json(RestClient& client, const std::string& path, const nlohmann::json& body);

/// Every item of a listing, `items` or `features`, up to ten thousand.
Result<std::vector<nlohmann::json>> get_items(RestClient& client, const std::string& path);

/// Waits for a job, the answer to a creation, to end.
/// returns  path of its result
/// errors   those of the client; canceled: by the user; conflict: failed or cancelled there, with its problem
Result<std::string> result_of_job(RestClient& client, const nlohmann::json& job);

/// A member's text; empty where there is none.
std::string text_of(const nlohmann::json& object, const char* key);

}  // namespace anchord::cli
