#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord {

/// The half of an Ed25519 key (RFC 8032) that anybody may have.
class Ed25519Public {
 public:
  using Bytes = std::array<std::uint8_t, 32>;
  explicit Ed25519Public(const Bytes& bytes) : bytes_(bytes) {}
  /// Of a PEM text ("-----BEGIN PUBLIC KEY-----"). errors: invalid_argument
  static Result<Ed25519Public> parse_pem(std::string_view pem);

  /// SubjectPublicKeyInfo, as `openssl pkey -pubin` reads it.
  std::string pem() const;
  /// The first 16 hex digits of the SHA-256 of the 32 bytes.
  std::string id() const;
  /// Whether the 64 bytes are this key's signature of the message.
  bool verifies(std::string_view message, std::string_view signature) const;

 private:
  Bytes bytes_;
};

/// A key that signs. Pure; safe to call from any thread.
class Ed25519Key {
 public:
  using Seed = std::array<std::uint8_t, 32>;
  explicit Ed25519Key(const Seed& seed);
  ~Ed25519Key();
  Ed25519Key(Ed25519Key&&) noexcept;

  const Ed25519Public& open_half() const { return open_; }
  std::string sign(std::string_view message) const;  ///< 64 bytes

 private:
  struct Key;
  std::unique_ptr<Key> key_;
  Ed25519Public open_;
};

}  // namespace anchord
