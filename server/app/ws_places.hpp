#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "api/kit/message.hpp"
#include "core/base/locked.hpp"

namespace anchord::server {

struct WsPlaceLimits {
  std::size_t all{64};
  std::size_t per_token{50};  ///< clients of one token (its browser sessions included)
  std::size_t reserved{8};    ///< of all, for operators and admins; never more than half
};

/// Who may hold a live connection: the one place where their number is decided. Thread-safe.
class WsPlaces {
 public:
  using Refusal = std::pair<std::uint16_t, std::string>;  ///< close code and reason

  explicit WsPlaces(WsPlaceLimits limits);
  /// A place for as long as somebody holds it, or why there is none: 4029 (the token has all of its own),
  /// 1013 (the server is full). `counted`: does the token count by itself (not with login off, where all are
  /// one)?
  std::variant<std::shared_ptr<void>, Refusal> take(const api::Principal& who, bool counted);
  std::size_t taken() const;

 private:
  struct Taken {
    std::size_t all{0};
    std::map<std::string, std::size_t> by_token;
  };
  std::optional<Refusal> refusal(Taken& taken, const api::Principal& who, bool counted) const;

  const WsPlaceLimits limits_;
  const std::shared_ptr<Locked<Taken>> taken_;
};

}  // namespace anchord::server
