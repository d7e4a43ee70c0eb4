#pragma once

#include <string>
#include <vector>

#include "core/floor_plan/wall_lines.hpp"

namespace anchord::floor_plan {

/// Corners of the largest building of a mask of walls, metres of the plan; openings in its walls are closed.
/// errors  weak_geometry (the walls enclose nothing)
Result<std::vector<Eigen::Vector2d>> building_outline(const Mask& walls, const std::vector<WallLine>& lines,
                                                      double main_rad, const TraceOptions& options,
                                                      std::vector<std::string>& notes);

}  // namespace anchord::floor_plan
