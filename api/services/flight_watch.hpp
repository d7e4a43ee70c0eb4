#pragma once

#include <chrono>
#include <deque>
#include <utility>

#include "api/services/alarm_rules.hpp"

namespace anchord::api {

/// Keeps what the alarms of one flight ask about. Not thread-safe.
class FlightWatch {
 public:
  using Steady = std::chrono::steady_clock::time_point;
  void note(const Fix& fix);
  void note_range(UtcTime measured);
  void note_lag(double lag_s, double sigma_s);
  /// The flight as it stands. Call it about once a second: a flight counts as happening now once ten looks
  /// saw its measured time pass about as fast as ours, and no longer when it runs ahead (an upload, a fast
  /// replay). One that falls silent stays what it was: silence is what the alarms are about.
  FlightPulse look(UtcTime newest_measured, Steady now);

 private:
  FlightPulse pulse_;
  std::deque<std::pair<UtcTime, Steady>> looks_;
};

}  // namespace anchord::api
