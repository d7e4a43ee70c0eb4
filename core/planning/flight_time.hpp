#pragma once

#include "core/planning/local_plan.hpp"

namespace anchord::planning {

/// What a flight of this plan takes from the start to the landing, s. How many turns, height searches and
/// points of the planner it needs is seen only in the air: one turn and no more in `low_s`; a turn and a
/// height search for every second anchor and a point beside every third waypoint in `expected_s`; for every
/// anchor and every second waypoint, slowed by wind, in `high_s`.
FlightTime flight_time(const LocalPlan& local, const Plan& plan);

}  // namespace anchord::planning
