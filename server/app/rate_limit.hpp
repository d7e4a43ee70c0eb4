#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/locked.hpp"

namespace anchord::server {

/// So many requests a second, and so many at once.
struct Rate {
  double per_s{}, burst{};
  /// A minute's worth at once, then as they come in again.
  static Rate per_minute(double n) { return {n / 60, n}; }
};

/// Token buckets by name. Counts requests, not rows. Bounded: the bucket that was idle longest leaves first.
/// Thread-safe.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;
  explicit RateLimit(std::size_t max_names = 10'000) : max_names_(max_names) {}

  /// Null: go on. Else the whole seconds to wait. A rate that is another than before holds from now on.
  std::optional<int> take(std::string_view name, const Rate& rate, Clock::time_point now);

 private:
  struct Bucket {
    double level{};
    Clock::time_point seen{};
  };
  const std::size_t max_names_;
  Locked<std::map<std::string, Bucket, std::less<>>> buckets_;
};

}  // namespace anchord::server
