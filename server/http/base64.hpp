#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace anchord::server {

/// RFC 4648 section 4, padding required; null for anything else.
std::optional<std::string> base64_decoded(std::string_view text);

}  // namespace anchord::server
