#include "core/planning/grid.hpp"

#include <string>

namespace anchord::planning {

Result<Grid> grid_around(const Eigen::Vector3d& centre_m, const GridOptions& options) {
  constexpr int k_max_points =
      1'000'000;  // a decision beyond that no longer fits between two points of a flight
  if (!centre_m.allFinite())
    return make_error(Errc::invalid_argument, "the centre of the grid is not finite");
  if (!(options.step_m > 0) || !(options.step_up_m > 0)) {
    return make_error(Errc::invalid_argument, "grid steps must be positive");
  }
  if (options.reach < 0 || options.reach_up < 0 || options.reach > 500 || options.reach_up > 500) {
    return make_error(Errc::invalid_argument, "grid reach must be 0 to 500 cells");
  }
  const int across = 2 * options.reach + 1, upward = 2 * options.reach_up + 1;
  if (across * across > k_max_points / upward) {
    return make_error(Errc::invalid_argument, "a grid of " + std::to_string(across) + " x " +
                                                  std::to_string(across) + " x " + std::to_string(upward) +
                                                  " points is too large");
  }
  Grid grid;
  for (int iy = -options.reach; iy <= options.reach; ++iy) {
    for (int ix = -options.reach; ix <= options.reach; ++ix) {
      for (int iz = -options.reach_up; iz <= options.reach_up; ++iz) {
        grid.push_back(centre_m +
                       Eigen::Vector3d(ix * options.step_m, iy * options.step_m, iz * options.step_up_m));
      }
    }
  }
  return grid;
}

}  // namespace anchord::planning
