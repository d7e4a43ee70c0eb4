#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/result.hpp"
#include "core/flight/operations.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/procedure/flight_priors.hpp"
#include "core/procedure/machine.hpp"
#include "core/types/flight_data.hpp"
#include "core/types/plan.hpp"
#include "drivers/sim/autopilot.hpp"
#include "drivers/sim/radio.hpp"
#include "drivers/sim/vehicle.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::flight {

struct ClosedLoopOptions {
  std::uint64_t seed = 1;
  double max_s = 3600;  ///< of the flight's own clock
  sim::VehicleOptions vehicle{};
  sim::RadioOptions radio{};
  sim::AutopilotOptions autopilot{};  ///< origin, home and vehicle are those of the world and of here
  double live_update_s = 4;           ///< of the running estimates
  bool use_priors = true;             ///< what turns and height searches told is a prior
};

/// What was flown and what came of it; places in truth.
struct ClosedLoopResult {
  FlightData data;
  std::map<NetworkId, AnchorPriors> priors;  ///< for the solve; in metres of the plan's origin
  std::vector<Estimate> live;                ///< as they stood at the end of the flight
  procedure::State state;
  double flight_s{}, wall_s{};
  std::vector<std::pair<double, LogEvent>> log;  ///< with the flight's time
  double clearance_m{1e9};                       ///< nearest to the outline
  double lowest_m{1e9};                          ///< between the first waypoint and the landing
  double home_m{};  ///< where it stands in the end, across, from where it took off
  bool landed{false};
};

/// A plan from the building's outline alone: no waypoint set by hand.
/// errors  as planning::generate_waypoints
Result<Plan> plan_from_outline(const sim::World& world);

/// The building with brick fronts instead of glass: every range goes through a wall.
sim::World walled_world();

/// Flies a plan in the simulated world, headless and as fast as the machine can: tag, rover, autopilot and
/// its MAVLink session, and the mission, procedure and planner that fly real ones (InlineFlight). The
/// measurements are those that a batch solve would get. errors: of the plan; what blocks the start for good
Result<ClosedLoopResult> fly_closed_loop(const sim::World& world, const Plan& plan,
                                         const ClosedLoopOptions& options);

/// The rival: rings round the building at 5 m, at these heights, as often as the time allows.
FlightData fly_ring(const sim::World& world, double duration_s, const std::vector<double>& heights_m,
                    const ClosedLoopOptions& options);

/// How an answer stands to the truth.
struct AnchorError {
  NetworkId anchor{};
  double error_m{};
  Verdict verdict{};
  bool inside{};  ///< truth inside the 95 % ellipsoid (chi-square, three dimensions: 7.815)
};
std::vector<AnchorError> assess(const sim::World& world, const FlightSolution& solution);
double median_error_m(std::vector<AnchorError> judged);

}  // namespace anchord::flight
