#include "api/admin/clock_watch.hpp"

#include <cmath>
#include <cstdio>

namespace anchord::api {

std::string ClockWatch::look(UtcTime wall, SteadyTime steady) {
  if (wall_) {
    const double step_s = seconds_between(*wall_, wall) - seconds_between(steady_, steady);
    if (std::abs(step_s) >= k_step_s) {
      stepped_ = steady;
      char by[64];
      std::snprintf(by, sizeof by, "%+.1f s (limit %.0f s)", step_s, k_step_s);
      text_ = "the system clock was changed by " + std::string(by) + ", from " + to_rfc3339(*wall_) + " to " +
              to_rfc3339(wall) +
              ": timestamps of the system jump there; leases, schedules and retention times do not. Check "
              "the clock";
    }
  }
  wall_ = wall;
  steady_ = steady;
  if (stepped_ && seconds_between(*stepped_, steady) >= k_stands_s) stepped_.reset();
  return stepped_ ? text_ : std::string();
}

}  // namespace anchord::api
