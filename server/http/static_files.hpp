#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"

namespace anchord::server {

/// The dashboard out of the binary: pre-compressed by Accept-Encoding, hashed names immutable, the rest
/// no-cache with ETag. Paths of the page's own views ("/live") get the index. Null: no such file. Built
/// without the dashboard: one line of text at "/".
std::optional<api::Response> static_file(const api::Request& request);

}  // namespace anchord::server
