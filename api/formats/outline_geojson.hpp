#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/planning/flight_plan.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// A building and where not to fly, from GeoJSON (docs/formats.md, "Outline").
struct OutlineRequest {
  Wgs84 origin;  ///< of the ENU metres below: middle of the outline's corners, height 0 = ground
  planning::FlightPlanInput input;
};

/// Everything that is wrong is reported at once, each with its JSON pointer; then nothing is returned. Never
/// throws.
std::optional<OutlineRequest> read_outline(std::string_view geojson, std::vector<FieldError>& errors);

}  // namespace anchord::api
