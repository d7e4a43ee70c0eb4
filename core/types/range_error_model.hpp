#pragma once

namespace anchord {

/// What a model believes about the error of one range before any position is known: plain numbers, so that
/// the estimator needs no classifier.
///
/// density of e = range - distance:
///   p_los N(e; los_bias_m, los_sigma_m) + (1 - p_los) EMG(e; nlos_bias_m, nlos_sigma_m, nlos_tail_m)
/// EMG = Gaussian plus an exponential delay of mean nlos_tail_m: a blocked path arrives late, never early.
struct RangeErrorModel {
  double p_los{1};
  double los_bias_m{0};
  double los_sigma_m{0.049};  ///< sqrt(2401 mm^2), dissertation 7.2.3
  double nlos_bias_m{0};
  double nlos_sigma_m{0.1};
  double nlos_tail_m{0.3};
};

}  // namespace anchord
