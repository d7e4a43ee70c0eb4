#pragma once

#include "core/planning/candidates.hpp"
#include "core/planning/next_point.hpp"

namespace anchord::planning {

/// Why candidates may not be flown to, of a whole grid at once: tried in vain, visited, bounds, the way
/// there, on an anchor, over range; the first in this order is the reason. Points of the past mark the cells
/// near them, areas and walls are asked once for all candidates above one another. `grid` is
/// grid_around(current).
Refusals refusals_of(const NextPointInput& input, const NextPointOptions& options,
                     const Eigen::Vector3d& current, const Grid& grid);

/// Whether a candidate is farther from a place than max_range_m; false without one.
bool out_of_range(const NextPointOptions& options, const Eigen::Vector3d& point_m,
                  const Eigen::Vector3d& place_m);

}  // namespace anchord::planning
