#include "core/base/ed25519.hpp"

#include <openssl/evp.h>

#include <algorithm>
#include <optional>
#include <stdexcept>

#include "core/base/base64.hpp"
#include "core/base/bytes.hpp"
#include "core/base/sha256.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_signature_bytes = 64;
constexpr std::string_view k_begin = "-----BEGIN PUBLIC KEY-----", k_end = "-----END PUBLIC KEY-----";
/// SubjectPublicKeyInfo of Ed25519 before the 32 bytes of the key (RFC 8410 section 4).
constexpr std::array<std::uint8_t, 12> k_info{0x30, 0x2a, 0x30, 0x05, 0x06, 0x03,
                                              0x2b, 0x65, 0x70, 0x03, 0x21, 0x00};

using Pkey = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Context = std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)>;

Ed25519Public open_half_of(EVP_PKEY* key) {
  Ed25519Public::Bytes bytes{};
  std::size_t size = bytes.size();
  if (key == nullptr || EVP_PKEY_get_raw_public_key(key, bytes.data(), &size) != 1)
    throw std::runtime_error("OpenSSL cannot create an Ed25519 key");
  return Ed25519Public(bytes);
}

}  // namespace

Result<Ed25519Public> Ed25519Public::parse_pem(std::string_view pem) {
  const auto refused = [] {
    return make_error(Errc::invalid_argument,
                      "this is not a public Ed25519 key in PEM form (BEGIN PUBLIC KEY)");
  };
  const auto from = pem.find(k_begin), to = pem.find(k_end);
  if (from == std::string_view::npos || to == std::string_view::npos || to < from) return refused();
  std::string text;
  for (const char c : pem.substr(from + k_begin.size(), to - from - k_begin.size()))
    if (c != '\n' && c != '\r' && c != ' ') text += c;
  const auto der = from_base64(text);
  Bytes bytes{};
  if (!der || der->size() != k_info.size() + bytes.size()) return refused();
  const auto* data = reinterpret_cast<const std::uint8_t*>(der->data());
  if (!std::equal(k_info.begin(), k_info.end(), data)) return refused();
  std::copy_n(data + k_info.size(), bytes.size(), bytes.begin());
  return Ed25519Public(bytes);
}

std::string Ed25519Public::pem() const {
  std::string der(reinterpret_cast<const char*>(k_info.data()), k_info.size());
  der.append(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
  return std::string(k_begin) + '\n' + base64(der) + '\n' + std::string(k_end) + '\n';
}

std::string Ed25519Public::id() const {
  Sha256 sum;
  sum.add(std::string_view(reinterpret_cast<const char*>(bytes_.data()), bytes_.size()));
  return sum.hex().substr(0, 16);
}

bool Ed25519Public::verifies(std::string_view message, std::string_view signature) const {
  if (signature.size() != k_signature_bytes) return false;
  const Pkey key(EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr, bytes_.data(), bytes_.size()),
                 &EVP_PKEY_free);
  const Context context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  return key && EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, key.get()) == 1 &&
         EVP_DigestVerify(context.get(), bytes_of(signature), signature.size(), bytes_of(message),
                          message.size()) == 1;
}

struct Ed25519Key::Key {
  Pkey pkey;
};

Ed25519Key::Ed25519Key(const Seed& seed)
    : key_(std::make_unique<Key>(
          Key{Pkey(EVP_PKEY_new_raw_private_key(EVP_PKEY_ED25519, nullptr, seed.data(), seed.size()),
                   &EVP_PKEY_free)})),
      open_(open_half_of(key_->pkey.get())) {}
Ed25519Key::~Ed25519Key() = default;
Ed25519Key::Ed25519Key(Ed25519Key&&) noexcept = default;

std::string Ed25519Key::sign(std::string_view message) const {
  const Context context(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  std::string value(k_signature_bytes, '\0');
  std::size_t size = value.size();
  if (EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_->pkey.get()) != 1 ||
      EVP_DigestSign(context.get(), reinterpret_cast<unsigned char*>(value.data()), &size, bytes_of(message),
                     message.size()) != 1)
    throw std::runtime_error("OpenSSL cannot sign");
  return value;
}

}  // namespace anchord
