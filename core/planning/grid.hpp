#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::planning {

/// The grid round the aircraft from which its next point is taken (8.4.3).
struct GridOptions {
  double step_m = 0.5;  ///< the dissertation flew 0.48
  double step_up_m = 0.5;
  int reach = 1;     ///< cells each way in the plane; 1 = the eight neighbours of Fig 8.7
  int reach_up = 0;  ///< cells up and down; 0 = stay at this height
};

/// Structure of arrays, as the batch kernel reads it.
struct Grid {
  std::vector<double> x_m, y_m, z_m;
  std::size_t size() const { return x_m.size(); }
  Eigen::Vector3d at(std::size_t i) const { return {x_m[i], y_m[i], z_m[i]}; }
};

/// (2 reach + 1)^2 (2 reach_up + 1) points, the middle one included; order: y slowest, then x, then z, each
/// rising. Among equal values the first wins, which is what makes the path of Fig 8.8 turn to negative y.
/// errors: invalid_argument (steps not positive, negative reach, more than a million points, centre not
/// finite)
Result<Grid> grid_around(const Eigen::Vector3d& centre_m, const GridOptions& options);

}  // namespace anchord::planning
