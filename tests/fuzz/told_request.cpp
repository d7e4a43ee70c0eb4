// A request as any client may send it, head and body, to the problem it is answered with and the log line.
#include <cstdint>
#include <string>
#include <string_view>

#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "server/http/request_check.hpp"
#include "server/http/request_parser.hpp"
#include "tests/fuzz/told.hpp"

namespace {

using namespace anchord;

/// Echoes what it refuses, as the handlers do: keys, values, parameters, headers.
api::Response picky(const api::Request& request) {
  std::vector<api::FieldError> errors;
  for (const auto& [key, value] : request.query)
    errors.push_back(
        {"/" + to_utf8(key, 60), "unknown_field", "no such query parameter: " + to_utf8(value, 60)});
  for (const auto& [key, value] : request.headers)
    errors.push_back({"/" + key, "refused", "the value is " + value, json_text(value)});
  for (const auto& [key, value] : request.params) errors.push_back({"/" + key, "not_found", value});
  const auto body = api::json_body(request, true);
  api::Fields fields(body, "", errors);
  (void)fields.text("name", 20, true);
  (void)fields.number("n", 0, 10);
  (void)fields.word("kind", {"gnss", "pozyx"});
  fields.finish();
  api::refuse_if_any(errors);
  return api::problem(404, "not-found", request.path);
}

const api::Router& router() {
  static const api::Router one = [] {
    api::Router made;
    for (const auto method : {api::Method::get, api::Method::post}) {
      made.add({method, "/api/{what}/{id}", api::Access::open(), picky});
      made.add({method, "/api/{what}", api::Access::any_token(), picky});
    }
    return made;
  }();
  return one;
}

void told_answer(const api::Response& response) {
  const auto json = nlohmann::json::parse(response.body, nullptr, false);
  fuzz::require(json.is_object() && json.contains("status"), "a refusal is a problem");
  fuzz::told_json(json);
  fuzz::told(json.value("detail", ""));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace anchord::server;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  static const HttpLimits limits;
  static const HostPolicy policy{{"localhost", "127.0.0.1"}, {}};
  const auto refused = [](const Refusal& why) {
    told_answer(api::problem(why.status, why.type, why.detail));
    return 0;
  };
  const auto scan = scan_head(bytes, {}, limits);
  if (const auto* why = std::get_if<Refusal>(&scan)) return refused(*why);
  const auto& head = std::get<HeadScan>(scan);
  if (head.head_end == 0) return 0;
  RequestParser parser(limits);
  const std::string raw(bytes.substr(0, head.head_end));
  if (const auto why = parser.parse_head(raw)) return refused(*why);
  HeadCheck judgement = validate_head(parser.head(), limits, policy);
  if (const auto* why = std::get_if<Refusal>(&judgement)) return refused(*why);
  auto request = std::move(std::get<ValidHead>(judgement).request);
  request.body = bytes.substr(head.head_end);
  fuzz::told(request.path);
  for (const auto& [key, value] : request.headers) fuzz::told(value);
  for (const auto& [key, value] : request.query) fuzz::told(value);
  const auto response = router().handle(request);
  if (response.status >= 400) told_answer(response);
  fuzz::require(response.status != 500, "no bytes make a fault of ours");
  return 0;
}
