#pragma once

#include <Eigen/Core>

#include "core/floor_plan/georeference.hpp"
#include "core/floor_plan/image.hpp"

namespace anchord::floor_plan {

/// Corners of what a plan covers, ENU metres: left lower, right upper.
struct Extent {
  Eigen::Vector2d low_m{0, 0}, high_m{0, 0};
};

/// errors   invalid_argument (more than 5 km)
Result<Extent> extent_of(const Image& image, const PlanTransform& transform);

/// A plan turned north up: its left lower and right upper corner in ENU metres, outside of it transparent.
struct Backdrop {
  Image image;  ///< 4 channels
  Eigen::Vector2d low_m{0, 0}, high_m{0, 0};
};

/// errors   invalid_argument (the plan would cover more than 5 km)
Result<Backdrop> make_backdrop(const Image& rgb, const PlanTransform& transform, int longest_side_px = 4096);

}  // namespace anchord::floor_plan
