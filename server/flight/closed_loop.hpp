#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/procedure/flight_clues.hpp"
#include "core/procedure/flight_engine.hpp"
#include "core/types/flight_data.hpp"
#include "core/types/plan.hpp"
#include "drivers/sim/radio.hpp"
#include "drivers/sim/vehicle.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::flight {

struct ClosedLoopOptions {
  std::uint64_t seed = 1;
  double max_s = 3600;  ///< of the flight's own clock
  sim::VehicleOptions vehicle{};
  sim::RadioOptions radio{};
  double live_update_s = 4;  ///< of the running estimates
  bool use_clues = true;     ///< what turns and height searches told is a prior
};

/// What was flown and what came of it.
struct ClosedLoopResult {
  FlightData data;
  std::map<NetworkId, AnchorClues> clues;  ///< for the solve; in metres of the plan's origin
  std::vector<Estimate> live;              ///< as they stood at the end of the flight
  procedure::State state;
  double flight_s{}, wall_s{};
  std::vector<procedure::Happening> happenings;
  std::size_t n_decisions{};
  std::size_t n_orders{};
};

/// A plan from the building's outline alone: no waypoint set by hand.
/// errors  as planning::generate_waypoints
Result<Plan> plan_from_outline(const sim::World& world);

/// The building with brick fronts instead of glass: every range goes through a wall.
sim::World walled_world();

/// Flies a plan in the simulated world, headless and as fast as the machine can: vehicle, tag and rover, live
/// estimates, procedure, planner. The measurements are those that a batch solve would get.
Result<ClosedLoopResult> fly_closed_loop(const sim::World& world, const Plan& plan,
                                         const ClosedLoopOptions& options);

/// The rival: rings round the building at 5 m, at these heights, as often as the time allows.
FlightData fly_ring(const sim::World& world, double duration_s, const std::vector<double>& heights_m,
                    const ClosedLoopOptions& options);

/// At most one range of each anchor per 0.3 m of the tag's way: a hundred ranges at one spot share one error
/// of walls and rover, and would outvote the rest (the dissertation takes the mean per measuring
/// point, 6.2.1).
FlightData thinned_at_rest(FlightData data);

/// How an answer stands to the truth.
struct Judged {
  NetworkId anchor{};
  double error_m{};
  Verdict verdict{};
  bool inside{};  ///< truth inside the 95 % ellipsoid (chi-square, three dimensions: 7.815)
};
std::vector<Judged> judge(const sim::World& world, const FlightSolution& solution);
double median_error_m(std::vector<Judged> judged);

}  // namespace anchord::flight
