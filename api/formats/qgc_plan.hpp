#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/types/plan.hpp"

namespace anchord::api {

/// Reads a QGroundControl .plan (version 1): waypoints (16), take-off (22), a yaw change behind a waypoint
/// (115: a turn there), fence polygons (inclusion: the fence, exclusion: no-fly) and circles (as 24 corners).
/// A second fence, and a shape that cannot be read, are errors: an area that bounds a flight is never lost.
/// Return and land are what a flight does anyway. `notes` says what was left out. Settings and name are the
/// defaults; the caller names the plan.
Plan read_qgc_plan(const nlohmann::json& file, std::vector<std::string>& notes,
                   std::vector<FieldError>& errors);

}  // namespace anchord::api
