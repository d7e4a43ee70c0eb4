#pragma once

#include <vector>

#include "core/floor_plan/trace.hpp"
#include "core/floor_plan/wall_faces.hpp"

namespace anchord::floor_plan {

/// A wall's middle line; metres of the plan.
struct WallLine {
  Eigen::Vector2d at_m{0, 0}, along{1, 0};
  double from_m{}, to_m{}, thickness_m{};
  bool from_meets{false}, to_meets{false};  ///< that end lies on another wall's line
  double length_m() const { return to_m - from_m; }
  Eigen::Vector2d begin_m() const { return at_m + from_m * along; }
  Eigen::Vector2d end_m() const { return at_m + to_m * along; }
};

/// Walls between facing edges of ink, joined where they meet.
std::vector<WallLine> wall_lines(const std::vector<std::vector<Face>>& contours, const Mask& mask,
                                 const TraceOptions& options);

}  // namespace anchord::floor_plan
