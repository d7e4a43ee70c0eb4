#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace anchord {

/// RFC 4648 section 4, with padding.
std::string base64(std::string_view bytes);
/// Null for anything else, a missing padding included.
std::optional<std::string> from_base64(std::string_view text);

}  // namespace anchord
