#pragma once

#include <string_view>

namespace anchord {

/// As OpenSSL wants them.
inline const unsigned char* bytes_of(std::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

}  // namespace anchord
