#pragma once

#include <nlohmann/json_fwd.hpp>

#include "api/flight/flight_service.hpp"

namespace anchord::api {

nlohmann::ordered_json flown_plan_json(const MissionId& mission, const FlightService::FlownPlan& flown);
/// What a change adds, removes and moves, what it costs, and why it is refused.
nlohmann::ordered_json plan_difference_json(const MissionId& mission,
                                            const FlightService::PlanDifference& difference);

}  // namespace anchord::api
