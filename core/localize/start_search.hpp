#pragma once

#include <Eigen/Core>
#include <vector>

namespace anchord {

/// How the search for one anchor's start went: where its descents ended.
struct StartSearch {
  struct Place {
    Eigen::Vector3d position_m{0, 0, 0};
    double cost{};                ///< of thinned, untempered ranges, priors beside them included
    int n_starts{}, n_settled{};  ///< ended here; of those, within the iterations allowed
  };
  int n_starts{}, n_settled{};
  std::vector<Place> places;  ///< best first, at most 6; ends within 0.2 m of each other are one
};

}  // namespace anchord
