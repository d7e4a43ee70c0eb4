#include "core/base/sha256.hpp"

#include <openssl/evp.h>

#include <bit>

#include "core/base/check.hpp"

namespace anchord {

struct Sha256::Context {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> openssl{EVP_MD_CTX_new(), &EVP_MD_CTX_free};
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  // Looked up once: MAVLink signs every frame.
  static const EVP_MD* const k_sha256 = EVP_MD_fetch(nullptr, "SHA256", nullptr);
  ANCHORD_CHECK(EVP_DigestInit_ex(context_->openssl.get(), k_sha256, nullptr) == 1, "SHA-256");
}
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;
Sha256::~Sha256() = default;

void Sha256::add(std::string_view bytes) {
  ANCHORD_CHECK(EVP_DigestUpdate(context_->openssl.get(), bytes.data(), bytes.size()) == 1, "SHA-256");
}

void Sha256::add(std::uint64_t value) {
  std::array<char, 8> bytes{};
  for (std::size_t i = 0; i < 8; ++i)
    bytes[i] = static_cast<char>(static_cast<unsigned char>(value >> (8 * i)));
  add(std::string_view{bytes.data(), bytes.size()});
}

void Sha256::add(double value) { add(std::bit_cast<std::uint64_t>(value + 0.0)); }

std::array<std::uint8_t, 32> Sha256::digest() {
  std::array<std::uint8_t, 32> out{};
  ANCHORD_CHECK(EVP_DigestFinal_ex(context_->openssl.get(), out.data(), nullptr) == 1, "SHA-256");
  return out;
}

std::string Sha256::hex() {
  std::string out;
  for (const std::uint8_t byte : digest()) {
    out += "0123456789abcdef"[byte >> 4U];
    out += "0123456789abcdef"[byte & 15U];
  }
  return out;
}

}  // namespace anchord
