#pragma once

#include "drivers/sim/autopilot.hpp"
#include "server/flight/closed_loop.hpp"

namespace anchord::flight {

struct PilotedLoopOptions {
  ClosedLoopOptions loop{};
  sim::AutopilotOptions autopilot{};  ///< origin, home and vehicle are taken from the world and the loop
};

struct PilotedLoopResult {
  ClosedLoopResult flown;
  double clearance_m{1e9};  ///< nearest to the outline, in truth
  double lowest_m{1e9};     ///< between the first waypoint and the landing, in truth
  double home_m{};          ///< where it stands in the end, across, from where it took off
  bool landed{false};
};

/// The closed loop flown over MAVLink: the same world, measurements, procedure and planner, with the real
/// session and the simulated autopilot between the procedure and the vehicle.
Result<PilotedLoopResult> fly_piloted_loop(const sim::World& world, const Plan& plan,
                                           const PilotedLoopOptions& options);

}  // namespace anchord::flight
