#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/localize/live_flight.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::testing {

/// A way positions go wrong in the field; the rest of the flight is as it was.
struct SpoiltWay {
  std::string name;
  std::function<void(std::vector<Fix>&)> spoil;
  friend void PrintTo(const SpoiltWay& way, std::ostream* out) { *out << way.name; }
};
const std::vector<SpoiltWay>& spoilt_ways();

/// A position moved in its own axes (ENU, or local).
void move(Fix& fix, const Eigen::Vector3d& by_m);
double apart_m(const Wgs84& a, const Wgs84& b);
/// Ranges in order of time, fixes in the order given, as a stream would bring them; then the end.
void play(LiveFlight& live, const FlightData& flight);

}  // namespace anchord::testing
