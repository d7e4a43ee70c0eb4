#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/planning/bounds.hpp"

namespace anchord::planning {

/// Shortest legal way of straight legs from one point to another, round no-fly areas and walls: the points
/// after `from_m`, `to_m` last. Nothing when there is none. Turning points lie round the areas at the
/// keep-out distance; a start inside a keep-out zone is left outwards first. Pure; a few hundred path tests
/// for a building (below a millisecond).
std::optional<std::vector<Eigen::Vector3d>> route(const Bounds& bounds, const Eigen::Vector3d& from_m,
                                                  const Eigen::Vector3d& to_m);

}  // namespace anchord::planning
