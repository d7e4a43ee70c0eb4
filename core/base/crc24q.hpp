#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace anchord {

/// CRC-24Q of RTCM 10403.3 section 4.2 (polynomial 0x1864CFB, start 0); 0 over a frame with its own.
/// A byte at a time: a stream of false preambles asks for a thousand bytes of it each.
inline std::uint32_t crc24q(std::string_view bytes) {
  static constexpr auto k_table = [] {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t i = 0; i < table.size(); ++i) {
      std::uint32_t crc = i << 16;
      for (int bit = 0; bit < 8; ++bit) crc = crc << 1 ^ ((crc & 0x800000u) != 0 ? 0x1864cfbu : 0u);
      table[i] = crc & 0xffffffu;
    }
    return table;
  }();
  std::uint32_t crc = 0;
  for (const char c : bytes)
    crc = (crc << 8 & 0xffffffu) ^ k_table[(crc >> 16 ^ static_cast<unsigned char>(c)) & 0xffu];
  return crc;
}

}  // namespace anchord
