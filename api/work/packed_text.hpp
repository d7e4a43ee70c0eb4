#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord::api {

/// Bytes as text for a message: compressed (zlib, fastest), then base64.
std::string packed_text(std::string_view bytes);
/// errors: bad_frame (no such text, cut off, or more than `most` bytes)
Result<std::string> from_packed_text(std::string_view text, std::size_t most);

}  // namespace anchord::api
