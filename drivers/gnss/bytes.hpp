#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>
#include <type_traits>

namespace anchord::gnss {

/// Little-endian value at an offset; the caller has checked the length. Both binary formats are packed.
template <class T>
T read_le(std::string_view bytes, std::size_t offset) {
  static_assert(std::is_trivially_copyable_v<T>);
  if constexpr (std::is_floating_point_v<T>) {
    using Bits = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;
    const Bits bits = read_le<Bits>(bytes, offset);
    T out;
    std::memcpy(&out, &bits, sizeof out);
    return out;
  } else {
    std::uint64_t out = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      out |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[offset + i])) << (8 * i);
    }
    return static_cast<T>(out);
  }
}

}  // namespace anchord::gnss
