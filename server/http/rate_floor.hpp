#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

namespace anchord::server {

/// Deadline of a body that must keep a floor rate: bytes buy time, at most one window ahead. A body slower
/// than the floor runs out of it after one window; a steady one never does. Time we made the peer wait is
/// given back.
class RateFloor {
 public:
  using Clock = std::chrono::steady_clock;
  RateFloor(Clock::time_point now, std::chrono::milliseconds window, std::uint64_t bytes_per_s)
      : window_(window), bytes_per_s_(bytes_per_s), deadline_(now + window) {}
  Clock::time_point deadline() const { return deadline_; }
  void received(Clock::time_point now, std::uint64_t bytes) {
    const auto bought = std::chrono::microseconds(bytes * 1'000'000 / bytes_per_s_);
    deadline_ = std::min(deadline_ + bought, now + window_);
  }
  void waited(Clock::duration for_us) { deadline_ += for_us; }

 private:
  std::chrono::milliseconds window_;
  std::uint64_t bytes_per_s_;
  Clock::time_point deadline_;
};

}  // namespace anchord::server
