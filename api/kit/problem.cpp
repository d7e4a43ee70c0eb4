#include "api/kit/problem.hpp"

#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

const std::vector<ProblemType>& problem_types() {
  static const std::vector<ProblemType> k_types{
      {"validation", "Request is not valid",
       "One or more fields are wrong; errors lists each of them with its JSON pointer."},
      {"malformed", "Request cannot be read", "The request is not well-formed JSON, CSV or HTTP."},
      {"unauthorized", "Authentication required",
       "Send a token in the header Authorization: Bearer, or log in."},
      {"forbidden", "Not allowed", "The token is valid but does not have the role that is given in detail."},
      {"not-found", "Not found", "There is nothing at this address."},
      {"method", "Method not allowed", "The address exists; the header Allow lists the methods it supports."},
      {"not-acceptable", "Format not available",
       "None of the requested formats is available at this address."},
      {"conflict", "Conflict", "The request contradicts what is stored; what is stored was not changed."},
      {"no-control", "No control",
       "Another operator or nobody has control of the aircraft; take control first."},
      {"gone", "Gone", "The resource existed and was removed."},
      {"precondition-failed", "Precondition failed",
       "The resource changed since it was read; read it again."},
      {"too-large", "Request too large", "The body exceeds the limit of this address."},
      {"media-type", "Unsupported media type",
       "Content-Type is missing or not supported, or the body is compressed."},
      {"state", "Not in this state", "The current state does not permit this action."},
      {"precondition-required", "Precondition required",
       "Send the header If-Match with the ETag that was read."},
      {"rate-limited", "Too many requests", "Wait as many seconds as the header Retry-After says."},
      {"quota", "Quota used up",
       "The token has reached the limit of stored answers; detail says which limit and what to do."},
      {"internal", "Internal error", "A fault of the server; look for the request id in its log."},
      {"overloaded", "Try again later", "A queue is full or storage is unavailable; nothing was changed."},
      {"read-only", "Storage is full", "Nothing was stored; free disk space."},
      {"unsupported", "Not supported", "The request is valid, but this build does not support it."},
  };
  return k_types;
}

std::string problem_json(int status, std::string_view type, std::string_view detail,
                         const std::vector<FieldError>& errors, std::string_view instance,
                         std::string_view request_id) {
  std::string title(type);
  for (const auto& known : problem_types()) {
    if (known.type == type) title = known.title;
  }
  Ordered body{{"type", "/problems/" + std::string(type)}, {"title", title}, {"status", status}};
  if (!detail.empty()) body["detail"] = detail;
  if (!instance.empty()) body["instance"] = instance;
  if (!request_id.empty()) body["request_id"] = request_id;
  if (!errors.empty()) {
    Ordered list = Ordered::array();
    for (const auto& error : errors) {
      Ordered item{{"pointer", error.pointer}, {"code", error.code}, {"detail", error.detail}};
      if (!error.value_json.empty()) {
        auto value = Ordered::parse(error.value_json, nullptr, false);
        if (!value.is_discarded()) item["value"] = std::move(value);
      }
      list.push_back(std::move(item));
    }
    body["errors"] = std::move(list);
  }
  // Bytes of the client may be inside; anything that is not UTF-8 becomes U+FFFD instead of an exception.
  return to_wire(body);
}

Response problem(int status, std::string_view type, std::string detail,
                 const std::vector<FieldError>& errors) {
  Response response;
  response.status = status;
  response.header("Content-Type", "application/problem+json");
  if (status == 401) response.header("WWW-Authenticate", "Bearer realm=\"anchord\"");
  if (status == 503 || status == 429) response.header("Retry-After", "1");
  response.body = problem_json(status, type, detail, errors);
  return response;
}

Response problem_of(const Error& error) {
  switch (error.code) {
    case Errc::bad_frame:
    case Errc::checksum_mismatch:
      return problem(400, "malformed", error.message);
    case Errc::too_few_observations:
    case Errc::weak_geometry:
    case Errc::no_convergence:
      return problem(422, "state", error.message);
    case Errc::not_found:
      return problem(404, "not-found", error.message);
    case Errc::conflict:
      return problem(409, "conflict", error.message);
    case Errc::invalid_argument:
      return problem(422, "validation", error.message);
    case Errc::unsupported:
      return problem(422, "unsupported", error.message);
    case Errc::queue_full:
    case Errc::link_lost:
    case Errc::storage_unavailable:
    case Errc::canceled:
      return problem(503, "overloaded", error.message);
    case Errc::storage_full:
      return problem(507, "read-only", error.message);
    case Errc::internal:
      // The message may name files and tables: it belongs in the log, the request id leads there.
      return problem(500, "internal", "");
  }
  return problem(500, "internal", "");
}

void throw_problem(int status, std::string_view type, std::string detail,
                   const std::vector<FieldError>& errors) {
  throw ProblemException{problem(status, type, std::move(detail), errors)};
}

}  // namespace anchord::api
