#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/types/plan.hpp"

namespace anchord::api {

/// Reads a GeoJSON FeatureCollection (docs/formats.md, Plan files): the outline of the building, areas of
/// kind no_fly and fence, and points as waypoints. An area that bounds a flight is taken or is an error,
/// never lost; `notes` has what was left out and bounds nothing.
Plan read_geojson_plan(const nlohmann::json& file, std::vector<std::string>& notes,
                       std::vector<FieldError>& errors);

}  // namespace anchord::api
