#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace anchord {

/// SHA-256 (FIPS 180-4), for content digests of data sets and signatures of
/// MAVLink frames. No constant time is promised.
class Sha256 {
 public:
  void add(std::string_view bytes);
  void add(double value);  ///< IEEE 754 bits, little endian; -0 counts as 0
  void add(std::uint64_t value);
  std::array<std::uint8_t, 32> digest();  ///< call once
  std::string hex();                      ///< the digest as 64 digits; call once

 private:
  void block(const unsigned char* bytes);
  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> buffer_{};
  std::size_t filled_{0};
  std::uint64_t length_{0};
};

}  // namespace anchord
