#pragma once

#include <compare>
#include <cstdint>

namespace anchord {

/// An instant of a clock that nobody sets: nanoseconds since an arbitrary start, the same for the whole
/// process.
struct SteadyTime {
  std::int64_t ns{};
  auto operator<=>(const SteadyTime&) const = default;
};

constexpr double seconds_between(SteadyTime a, SteadyTime b) {
  return static_cast<double>(b.ns - a.ns) * 1e-9;
}
constexpr SteadyTime later(SteadyTime t, std::int64_t ns) { return {t.ns + ns}; }

/// Where durations come from: leases, tickets, sessions, schedules, silence. Clock (core/base/time.hpp) is
/// for stamps alone, for a person or NTP may set it by years at any moment.
class SteadyClock {
 public:
  virtual ~SteadyClock() = default;
  virtual SteadyTime now() const = 0;
};

/// Goes on while the machine sleeps (CLOCK_BOOTTIME): a lease does not outlive a closed lid.
class SystemSteadyClock final : public SteadyClock {
 public:
  SteadyTime now() const override;
};

/// The system's.
const SteadyClock& system_steady_clock();

}  // namespace anchord
