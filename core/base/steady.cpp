#include "core/base/steady.hpp"

#include <ctime>

namespace anchord {

SteadyTime SystemSteadyClock::now() const {
  timespec at{};
  clock_gettime(CLOCK_BOOTTIME, &at);
  return {std::int64_t{at.tv_sec} * 1'000'000'000 + at.tv_nsec};
}

const SteadyClock& system_steady_clock() {
  static const SystemSteadyClock clock;
  return clock;
}

}  // namespace anchord
