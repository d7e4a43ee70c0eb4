#include "api/omlox/omlox_uuid.hpp"

#include <openssl/evp.h>

#include <algorithm>

#include "core/base/check.hpp"

namespace anchord::api {
namespace {

/// Of anchord's names; chosen by chance once.
constexpr std::string_view k_namespace = "f1d6f0c7-6f0e-4c55-9d0c-3f3a0a6f1b52";

}  // namespace

Uuid omlox_uuid(std::string_view kind, std::string_view name) {
  const Uuid space = parse_uuid(k_namespace).value();
  std::string text(reinterpret_cast<const char*>(space.bytes.data()), space.bytes.size());
  text.append(kind).append("/").append(name);
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned int size = 0;
  const int made = EVP_Digest(text.data(), text.size(), digest, &size, EVP_sha1(), nullptr);
  ANCHORD_CHECK(made == 1 && size >= 16, "SHA-1 is not available");
  Uuid out;
  std::copy_n(digest, out.bytes.size(), out.bytes.begin());
  out.bytes[6] = static_cast<std::uint8_t>((out.bytes[6] & 0x0f) | 0x50);
  out.bytes[8] = static_cast<std::uint8_t>((out.bytes[8] & 0x3f) | 0x80);
  return out;
}

}  // namespace anchord::api
