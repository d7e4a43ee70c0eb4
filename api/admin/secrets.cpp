#include "api/admin/secrets.hpp"

#include <openssl/crypto.h>
#include <openssl/rand.h>

#include <array>
#include <span>
#include <stdexcept>

namespace anchord::api {
namespace {

std::string hex(std::span<const unsigned char> bytes) {
  static constexpr std::string_view k_digits = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const unsigned char byte : bytes) {
    text.push_back(k_digits[byte >> 4]);
    text.push_back(k_digits[byte & 0x0f]);
  }
  return text;
}

}  // namespace

std::string random_hex_256() {
  std::array<unsigned char, 32> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) {
    throw std::runtime_error("the system provides no random numbers");
  }
  return hex(bytes);
}

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace anchord::api
