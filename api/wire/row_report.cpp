#include "api/wire/row_report.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/problem.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

Response row_report(const nlohmann::ordered_json& report, bool none_taken, const std::string& why) {
  Response response;
  if (!none_taken) {
    response.header("Content-Type", "application/json");
    response.body = to_wire(report);
    return response;
  }
  response = problem(422, "validation", why);
  auto body = nlohmann::ordered_json::parse(response.body);
  for (const auto& [name, value] : report.items()) body[name] = value;
  response.body = to_wire(body);
  return response;
}

}  // namespace anchord::api
