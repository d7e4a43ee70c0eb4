#pragma once

#include <algorithm>
#include <deque>

#include "core/base/time.hpp"

namespace anchord::flight {

/// When a row was measured, by the clock a flight is flown by. Clocks of rovers differ from ours by anything,
/// so the row of the last half minute that came with the least delay counts as come at once; what waited
/// longer in a queue is older by as much. Not thread-safe.
class MeasuredTime {
 public:
  double at(UtcTime measured, double arrival_s) {
    constexpr double k_window_s = 30;
    const double behind_s = arrival_s - measured.seconds();
    while (!least_.empty() && least_.back().behind_s >= behind_s) least_.pop_back();
    least_.push_back({arrival_s, behind_s});
    while (arrival_s - least_.front().arrival_s > k_window_s) least_.pop_front();
    return std::min(arrival_s, measured.seconds() + least_.front().behind_s);
  }

 private:
  struct Delay {
    double arrival_s{}, behind_s{};
  };
  std::deque<Delay> least_;  ///< of the window, least first: each later one is greater
};

}  // namespace anchord::flight
