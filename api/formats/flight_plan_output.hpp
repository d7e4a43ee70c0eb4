#pragma once

#include <string>

#include "core/planning/flight_plan.hpp"
#include "core/types/plan.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// A planned flight in the forms of `anchord plan flight`; `origin` is that of its ENU metres. Heights
/// are above ground, since an outline does not say how high the ground is.
std::string flight_plan_json(const planning::FlightPlan& plan, const Wgs84& origin);
std::string flight_plan_geojson(const planning::FlightPlan& plan, const Wgs84& origin);

/// The flight with its areas as a plan, for the forms that plans are written in (plan_export.hpp).
Plan flight_as_plan(const planning::FlightPlan& flight, const planning::FlightPlanInput& input,
                    const Wgs84& origin, const planning::FlightPlanOptions& options);

}  // namespace anchord::api
