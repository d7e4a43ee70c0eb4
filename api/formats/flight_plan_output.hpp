#pragma once

#include <string>

#include "core/planning/flight_plan.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// A planned flight in the three forms of `anchord plan flight`; `origin` is that of its ENU metres. Heights
/// are above ground, since an outline does not say how high the ground is.
std::string flight_plan_json(const planning::FlightPlan& plan, const Wgs84& origin);
std::string flight_plan_geojson(const planning::FlightPlan& plan, const Wgs84& origin);

/// QGroundControl .plan (version 1): take-off, waypoints with dwell and heading, return to launch; the
/// outline as an exclusion fence.
std::string flight_plan_qgc(const planning::FlightPlan& plan, const Wgs84& origin,
                            const planning::Polygon& outline, const planning::FlightPlanOptions& options);

}  // namespace anchord::api
