#pragma once

#include <string>

#include "core/base/result.hpp"
#include "core/types/plan.hpp"

namespace anchord::api {

/// The plan as QGroundControl flies it: take-off, waypoints with hold and heading, a yaw change where a turn
/// is made, return; the fence as inclusion polygon, outline and no-fly areas as exclusions. Altitudes
/// relative to home. errors  invalid_argument: a plan that is nowhere
Result<std::string> plan_qgc(const Plan& plan);
/// Waypoints, path, outline, fence and no-fly areas as features; read_geojson_plan() reads them again.
Result<std::string> plan_geojson(const Plan& plan);

}  // namespace anchord::api
