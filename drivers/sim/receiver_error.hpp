#pragma once

#include <cmath>

#include "drivers/sim/random.hpp"

namespace anchord::sim {

/// Error of the receiver: a slow part (multipath, base) and a fast one, together as large as the sigma it
/// states.
class ReceiverError {
 public:
  ReceiverError(double step_s, Random& random)
      : keep_(std::exp(-step_s / 15.0)), random_(random), slow_(random.normal3()) {}
  Eigen::Vector3d next(const Eigen::Vector3d& sigma_m) {
    slow_ = keep_ * slow_ + std::sqrt(1 - keep_ * keep_) * random_.normal3();
    return sigma_m.cwiseProduct(0.7 * slow_ + std::sqrt(1 - 0.49) * random_.normal3());
  }

 private:
  double keep_;
  Random& random_;
  Eigen::Vector3d slow_;
};

}  // namespace anchord::sim
