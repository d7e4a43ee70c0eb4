#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/locked.hpp"

namespace anchord::api {

/// Slows whoever sends secrets that are wrong: per token and address, per address, and per token from
/// everywhere. Counts only failures, and is asked only about them, so that nobody's bad tries refuse a secret
/// that is right. The wait grows with every further failure, up to a minute. Bounded: who was idle longest is
/// forgotten. Steady clock. Thread-safe.
class LoginGuard {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t k_max_names = 10'000;

  /// A wrong secret of `token_text` (its public part names the token; anything else is no token) came from
  /// `address`. Null: say that it is wrong. Else: so many seconds to wait.
  std::optional<int> failed(std::string_view token_text, std::string_view address, Clock::time_point now);

 private:
  struct Bucket {
    double level{};
    Clock::time_point seen{};
  };
  using Buckets = std::map<std::string, Bucket>;
  static std::optional<int> take(Buckets& buckets, const std::string& name, double burst, double per_s,
                                 Clock::time_point now);

  Locked<Buckets> buckets_;
};

}  // namespace anchord::api
