#pragma once

#include <cmath>

#include "core/ml/dataset.hpp"
#include "core/ml/random.hpp"

namespace anchord::ml {

/// Sixty placements in six places; NLOS links read weaker first paths and arrive late.
inline Dataset learning_world(std::uint64_t seed, bool with_truth, std::uint32_t placements = 60) {
  Dataset d;
  d.features = {"range_m", "rx_dbm", "fp_dbm", "rx_minus_fp_db", "rx_free_space_db"};
  Random r{seed};
  for (std::uint32_t placement = 0; placement < placements; ++placement) {
    const bool los = placement % 2 == 0;
    const double range = 2 + 8 * r.uniform(), loss = los ? 1 + 2 * r.uniform() : 3 + 6 * r.uniform();
    const double excess = los ? 0 : -0.5 * std::log(1 - r.uniform());
    for (int k = 0; k < 8; ++k) {
      const double rx = -75 - 20 * std::log10(range) - (los ? 0 : 4) + r.uniform(),
                   noise = 0.04 * (r.uniform() - 0.5);
      d.x.insert(d.x.end(), {range, rx, rx - loss, loss, rx + 20 * std::log10(range)});
      d.los.push_back(los);
      if (with_truth) d.bias_m.push_back(0.15 + excess + noise);
      d.weight.push_back(1);
      d.placement.push_back(placement);
      d.group.push_back(placement / 10);
    }
  }
  for (std::uint32_t g = 0; g * 10 < placements; ++g) d.group_names.push_back("room " + std::to_string(g));
  return d;
}

}  // namespace anchord::ml
