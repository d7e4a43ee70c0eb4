#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/types/plan.hpp"

namespace anchord::api {

/// Reads a plan drawn in a map program: KML 2.2 (docs/formats.md, Outline). Polygons: what a data field
/// `kind`, the folder or the name says (fence, no-fly, else the building's outline); points and the corners
/// of lines: waypoints, their height from the third coordinate above ground. `notes` says what was left out;
/// errors name the placemark.
Plan read_kml_plan(std::string_view text, std::vector<std::string>& notes, std::vector<FieldError>& errors);

/// A plan file of any kind we read: QGroundControl's .plan, a GeoJSON outline, KML. Told apart by what is in
/// it.
Plan read_plan_file(std::string_view text, std::vector<std::string>& notes, std::vector<FieldError>& errors);

}  // namespace anchord::api
