#pragma once

#include <Eigen/Core>
#include <optional>

namespace anchord {

/// A range joined to the tag position it was measured from.
struct Observation {
  Eigen::Vector3d tag_m{0, 0, 0};  ///< ENU or local
  double distance_m{};             ///< already corrected where a model did so
  double sigma_m{0.1};             ///< of the range alone
  Eigen::Matrix3d tag_covariance_m2{Eigen::Matrix3d::Zero()};
};

/// Error variances of the dissertation, section 7.2.3: ranges after mitigation, and the RTK position.
inline constexpr double k_variance_los_m2 = 2401e-6;
inline constexpr double k_variance_nlos_m2 = 54550e-6;
inline constexpr double k_variance_rtk_m2 = 400e-6;

}  // namespace anchord
