#pragma once

#include "api/kit/message.hpp"

namespace anchord::api {

inline constexpr std::string_view k_omlox_root = "/omlox/";

/// Makes an answer of 4xx or 5xx that is a problem (RFC 9457) what omlox has instead: {"type","code",
/// "message"}; 422 becomes 400, which is all that it knows of wrong requests. Any other answer stays.
void as_omlox_error(Response& response);

}  // namespace anchord::api
