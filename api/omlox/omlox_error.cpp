#include "api/omlox/omlox_error.hpp"

#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

std::string_view type_of(int status) {
  switch (status) {
    case 400:
      return "bad request";
    case 401:
      return "unauthorized";
    case 403:
      return "forbidden";
    case 404:
      return "not found";
    case 405:
      return "method not allowed";
    case 429:
      return "too many requests";
    case 503:
      return "service unavailable";
    default:
      return status < 500 ? "request failed" : "internal server error";
  }
}

std::string message_of(const Json& problem) {
  std::string out = problem.value("detail", std::string());
  if (out.empty()) out = problem.value("title", std::string());
  if (const auto errors = problem.find("errors"); errors != problem.end() && errors->is_array()) {
    for (const auto& one : *errors)
      out += "; " + one.value("pointer", std::string()) + ": " + one.value("detail", std::string());
  }
  return out;
}

}  // namespace

void as_omlox_error(Response& response) {
  if (response.status < 400 || response.body_stream) return;
  for (auto& [name, value] : response.headers) {
    if (name != "Content-Type" || value != "application/problem+json") continue;
    const Json problem = Json::parse(response.body, nullptr, false);
    if (!problem.is_object()) return;
    if (response.status == 422) response.status = 400;
    value = "application/json";
    response.body = to_wire(nlohmann::ordered_json{
        {"type", type_of(response.status)}, {"code", response.status}, {"message", message_of(problem)}});
    return;
  }
}

}  // namespace anchord::api
