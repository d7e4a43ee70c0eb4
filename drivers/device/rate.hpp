#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace anchord::device {

/// Rows per second over five whole seconds.
class Rate {
 public:
  void count(std::int64_t now_ns) {
    turn(now_ns);
    ++slots_[0];
  }
  double value(std::int64_t now_ns) const {
    Rate copy = *this;
    copy.turn(now_ns);
    std::uint64_t sum = 0;
    for (std::size_t i = 1; i < slots_.size(); ++i) sum += copy.slots_[i];
    return static_cast<double>(sum) / static_cast<double>(slots_.size() - 1);
  }

 private:
  void turn(std::int64_t now_ns) {
    for (const auto second = now_ns / 1'000'000'000; second_ < second; ++second_) {
      if (second - second_ > 10) second_ = second - 10;
      std::rotate(slots_.rbegin(), slots_.rbegin() + 1, slots_.rend());
      slots_[0] = 0;
    }
  }
  std::array<std::uint64_t, 6> slots_{};
  std::int64_t second_{0};
};

}  // namespace anchord::device
