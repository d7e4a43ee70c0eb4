#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace anchord {

/// RFC 4648 section 4, with padding.
std::string base64(std::string_view bytes);
/// Null for anything else, a missing padding included.
std::optional<std::string> from_base64(std::string_view text);
/// The same into `out`, which must be of just the size that the text holds; else false, and `out` is
/// anything.
bool decode_base64(std::string_view text, std::span<std::byte> out);

}  // namespace anchord
