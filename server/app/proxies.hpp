#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::server {

/// Proxies that may say for whom they ask (X-Forwarded-For). Everybody else's word about it is ignored.
class TrustedProxies {
 public:
  TrustedProxies() = default;
  /// "127.0.0.1", "::1", "10.0.0.0/8". errors: invalid_argument, naming the entry
  static Result<TrustedProxies> parse(const std::vector<std::string>& entries);

  bool trusts(std::string_view address) const;
  /// Who asks: `peer`, or, when that is a trusted proxy, the last address of the header that is none.
  std::string client(std::string_view peer, std::string_view forwarded_for) const;

 private:
  using Bytes = std::array<std::uint8_t, 16>;
  struct Network {
    Bytes address{};
    unsigned bits{128};
  };
  static bool read(std::string_view text, Bytes& out);
  std::vector<Network> networks_;
};

}  // namespace anchord::server
