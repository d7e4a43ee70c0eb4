#pragma once

#include <optional>
#include <vector>

#include "core/planning/next_point.hpp"

namespace anchord::planning {

/// By the walls of the bounds and by those that a person accepted: how likely a range is not line of sight.
/// Nothing where these let nothing through.
std::optional<double> expected_nlos(const NextPointInput& input, const Eigen::Vector3d& point_m,
                                    const Eigen::Vector3d& place_m);

/// expected_nlos() of every candidate of a grid to one place, walls asked once for all candidates above one
/// another.
class Sights {
 public:
  /// `upward`: candidates above one another, which stand side by side in the grid.
  Sights(const NextPointInput& input, const Grid& grid, std::size_t upward, const Eigen::Vector3d& place_m);
  bool all_clear() const { return p_nlos_.empty(); }
  std::optional<double> operator[](std::size_t i) const;

 private:
  std::vector<double> p_nlos_;  ///< empty: no wall is known; 2: nothing gets through
};

}  // namespace anchord::planning
