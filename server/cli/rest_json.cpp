#include "server/cli/rest_json.hpp"

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/progress.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;

Result<Json> object_of(const std::string& path, const std::string& body) {
  auto json = Json::parse(body, nullptr, false);
  if (!json.is_object())
    return make_error(Errc::invalid_argument, path + ": the answer is not a JSON object");
  return json;
}

}  // namespace

std::string text_of(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string{};
}

Result<Json> get_json(RestClient& client, const std::string& path) {
  BOOST_OUTCOME_TRY(const auto body, client.get(path));
  return object_of(path, body);
}

Result<Json> post_json(RestClient& client, const std::string& path, const Json& body) {
  const std::string key = to_string(make_uuid_v7(SystemClock{}.now()));
  BOOST_OUTCOME_TRY(const auto answer, client.post(path, "application/json", to_wire(body), key));
  return object_of(path, answer);
}

Result<std::vector<Json>> get_items(RestClient& client, const std::string& path) {
  std::vector<Json> out;
  std::string query = (path.find('?') == std::string::npos ? "?" : "&") + std::string("limit=1000");
  for (int page = 0; page < 10; ++page) {
    BOOST_OUTCOME_TRY(const auto json, get_json(client, path + query));
    for (const char* key : {"items", "features"}) {
      if (json.contains(key) && json[key].is_array())
        out.insert(out.end(), json[key].begin(), json[key].end());
    }
    const auto next = text_of(json, "next_cursor");
    if (next.empty()) return out;
    if (page == 0) query += "&cursor=";
    query = query.substr(0, query.rfind('=') + 1) + next;
  }
  return out;
}

Result<std::string> result_of_job(RestClient& client, const Json& job) {
  const std::string path = "/api/v1/jobs/" + text_of(job, "id");
  while (!interrupted()) {
    BOOST_OUTCOME_TRY(const auto now, get_json(client, path));
    const auto state = text_of(now, "state");
    if (state == "failed" || state == "canceled") {
      const auto problem = now.value("problem", Json::object());
      return make_error(Errc::conflict,
                        path + " " + state + ": " + (problem.is_object() ? text_of(problem, "detail") : ""));
    }
    if (state == "succeeded") {
      for (const auto& link : now.value("links", Json::array())) {
        if (text_of(link, "rel") == "result") return text_of(link, "href");
      }
      return make_error(Errc::invalid_argument, path + ": succeeded without a result");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  return make_error(Errc::canceled, "stopped; " + path + " continues on the server");
}

}  // namespace anchord::cli
