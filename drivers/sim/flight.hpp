#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "core/base/ids.hpp"
#include "core/types/flight_data.hpp"
#include "drivers/sim/impulse.hpp"
#include "drivers/sim/radio.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::sim {

/// How the demonstration flight is flown and measured.
struct SimulationOptions {
  std::uint64_t seed = 1;
  double duration_s = 210;    ///< for the whole path; the speed follows from it (2 m/s at 210 s)
  double range_rate_hz = 30;  ///< exchanges tried a second, over all anchors in turn
  double fix_rate_hz = 10;
  double clearance_m = 5;     ///< distance of the orbit from the building
  double lag_s = 0.02;        ///< range stamps are late against the receiver's by this much
  double float_share = 0.04;  ///< of the flight, in one piece: the rover has lost its integer fix
  UtcTime start = UtcTime::from_us(1'777'888'800'000'000);  ///< 2026-05-04T10:00:00Z
  RadioOptions radio{};
  std::optional<ImpulseOptions> impulse{};  ///< ranges as the tag reads them, with its impulse response
};

/// A flight and what only a simulator knows about it.
struct SimulatedFlight {
  FlightData data;
  std::map<NetworkId, Wgs84> truth_wgs84;
  std::map<NetworkId, Eigen::Vector3d> truth_enu_m;  ///< of world.origin
};

/// Where the drone's GNSS antenna is at a share of the path (0..1): three orbits at 3.5, 9 and 14 m with
/// climbs between them. Three heights, because one alone leaves every anchor a mirror solution; outside,
/// because inside has no RTK.
Eigen::Vector3d orbit_m(const World& world, const SimulationOptions& options, double share);

/// One seeded flight round the world's building. Same world, options and seed: the same numbers, bit for bit.
/// Pure; safe to call from any thread. Options must be positive; duration at most 4 h.
Result<SimulatedFlight> simulate_flight(const World& world, const SimulationOptions& options);

}  // namespace anchord::sim
