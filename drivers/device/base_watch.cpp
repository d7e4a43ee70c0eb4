#include "drivers/device/base_watch.hpp"

#include <cmath>
#include <cstdio>

namespace anchord::device {

namespace {

/// A base that stands still repeats itself to 0.1 mm; two of one network are kilometres apart.
constexpr double k_moved_m = 0.02;

std::string distance(double m) {
  char out[32];
  if (m < 1000)
    std::snprintf(out, sizeof out, "%.2f m", m);
  else
    std::snprintf(out, sizeof out, "%.0f km", m / 1000);
  return out;
}

}  // namespace

void BaseWatch::note(const BaseStation& told) {
  newest_ = told;
  if (!in_flight_ || !at_start_) at_start_ = told;
  if (!trouble_.empty()) return;
  const auto &a = at_start_->ecef_m, &b = told.ecef_m;
  const double moved_m = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  if (moved_m <= k_moved_m) return;
  const std::string from = std::to_string(at_start_->station), to = std::to_string(told.station);
  trouble_ =
      at_start_->station == told.station
          ? "base station " + to + " moved by " + distance(moved_m) +
                " in this flight: positions before and after differ by as much; give the base its known "
                "position and fly again"
          : "corrections came from base station " + from + " at first, then from " + to + ", " +
                distance(moved_m) +
                " away: positions before and after agree only if both are of one network; if not, fly again";
}

void BaseWatch::flight(bool begins) {
  in_flight_ = begins;
  at_start_ = newest_;
  trouble_.clear();
}

}  // namespace anchord::device
