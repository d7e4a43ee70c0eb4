#pragma once

#include <cmath>
#include <string>

#include "core/localize/flight_rows.hpp"

namespace anchord {

/// "14:03:10", UTC, of an instant of a flight. Whole seconds: a person looks for it in a plot.
inline std::string clock_text(const FlightRows& flight, double t_s) {
  return to_rfc3339(UtcTime{flight.epoch.ns + std::llround(t_s) * 1'000'000'000LL}).substr(11, 8);
}

}  // namespace anchord
