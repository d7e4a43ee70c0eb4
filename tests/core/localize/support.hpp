#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

#include "core/localize/observation.hpp"

namespace anchord::testing {

/// Ranges from n places spread through a box about the anchor's neighbourhood, with Gaussian noise of
/// sigma_m.
inline std::vector<Observation> ranges_from_box(std::mt19937_64& random, const Eigen::Vector3d& anchor,
                                                std::size_t n, const Eigen::Vector3d& half_box_m,
                                                double sigma_m) {
  std::uniform_real_distribution<double> side(-1, 1);
  std::normal_distribution<double> noise(0, 1);
  std::vector<Observation> rows;
  for (std::size_t i = 0; i < n; ++i) {
    Observation o;
    o.tag_m = {side(random) * half_box_m.x(), side(random) * half_box_m.y(), side(random) * half_box_m.z()};
    o.sigma_m = sigma_m;
    o.distance_m = (anchor - o.tag_m).norm() + sigma_m * noise(random);
    rows.push_back(o);
  }
  return rows;
}

}  // namespace anchord::testing
