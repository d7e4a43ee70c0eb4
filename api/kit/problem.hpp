#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "api/kit/message.hpp"
#include "core/base/result.hpp"

namespace anchord::api {

/// One wrong field of a request. `pointer` is an RFC 6901 JSON pointer ("/distance_m"), empty for the whole.
struct FieldError {
  std::string pointer, code, detail;
  std::string value_json{};  ///< what was sent, as JSON, at most 100 bytes; empty: not shown
};

/// RFC 9457 answer. `type` is the last part of the path: "validation" gives "/problems/validation"; the title
/// comes from the one catalogue (api.md section 5). Instance and request id are added by Router::dispatch.
Response problem(int status, std::string_view type, std::string detail,
                 const std::vector<FieldError>& errors = {});

/// The one table from Errc to HTTP status. 503 carries Retry-After.
Response problem_of(const Error& error);

/// JSON body of such an answer (for jobs, which carry a problem, and WebSocket errors).
std::string problem_json(int status, std::string_view type, std::string_view detail,
                         const std::vector<FieldError>& errors = {}, std::string_view instance = {},
                         std::string_view request_id = {});

/// Every problem type of the catalogue with its title and explanation, for /problems/{type}.
struct ProblemType {
  std::string_view type, title, explanation;
};
const std::vector<ProblemType>& problem_types();

/// An answer a handler leaves with from the depth of its checks; caught by Router::dispatch alone.
struct ProblemException {
  Response response;
};
[[noreturn]] void throw_problem(int status, std::string_view type, std::string detail,
                                const std::vector<FieldError>& errors = {});

/// value of a Result, or the problem of its error (thrown as ProblemException).
template <class T>
T value_or_problem(Result<T> result) {
  if (!result) throw ProblemException{problem_of(result.error())};
  if constexpr (!std::is_void_v<T>) return std::move(result).value();
}

}  // namespace anchord::api
