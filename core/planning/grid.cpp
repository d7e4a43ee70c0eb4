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
  const auto size = static_cast<std::size_t>(across) * static_cast<std::size_t>(across * upward);
  Grid grid;
  for (auto* column : {&grid.x_m, &grid.y_m, &grid.z_m}) column->resize(size);
  std::size_t i = 0;
  for (int iy = -options.reach; iy <= options.reach; ++iy) {
    const double y_m = centre_m.y() + iy * options.step_m;
    for (int ix = -options.reach; ix <= options.reach; ++ix) {
      const double x_m = centre_m.x() + ix * options.step_m;
      for (int iz = -options.reach_up; iz <= options.reach_up; ++iz, ++i) {
        grid.x_m[i] = x_m;
        grid.y_m[i] = y_m;
        grid.z_m[i] = centre_m.z() + iz * options.step_up_m;
      }
    }
  }
  return grid;
}

}  // namespace anchord::planning
