#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace anchord {

/// SHA-256 (FIPS 180-4) by OpenSSL: content digests, signatures of MAVLink frames, secrets as they are
/// stored.
class Sha256 {
 public:
  Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  ~Sha256();
  void add(std::string_view bytes);
  void add(double value);  ///< IEEE 754 bits, little endian; -0 counts as 0
  void add(std::uint64_t value);
  std::array<std::uint8_t, 32> digest();  ///< call once
  std::string hex();                      ///< the digest as 64 digits; call once

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

}  // namespace anchord
