#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/locked.hpp"

namespace anchord::server {

/// Token buckets by name: `per_s` requests a second, `burst` at once. Counts requests, not rows. Bounded: the
/// bucket that was idle longest leaves first. Thread-safe.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;
  RateLimit(double per_s, double burst, std::size_t max_names = 10'000)
      : per_s_(per_s), burst_(burst), max_names_(max_names) {}

  /// Null: go on. Else the whole seconds to wait.
  std::optional<int> take(std::string_view name, Clock::time_point now);

 private:
  struct Bucket {
    double level{};
    Clock::time_point seen{};
  };
  const double per_s_, burst_;
  const std::size_t max_names_;
  Locked<std::map<std::string, Bucket, std::less<>>> buckets_;
};

}  // namespace anchord::server
