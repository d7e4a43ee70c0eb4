#pragma once

#include <Eigen/Core>

namespace anchord {

/// 95 % region of a Gaussian position error, in the plane and upwards.
struct ErrorEllipse {
  double major_m{};  ///< semi-axis of the 95 % ellipse: sqrt(5.991 * largest eigenvalue)
  double minor_m{};
  double azimuth_deg{};  ///< of the major axis, clockwise from north, [0, 180)
  double h95_m{};        ///< radius that surely holds 95 %: the major semi-axis
  double v95_m{};        ///< 1.960 sigma of height
};

/// covariance_m2: 3x3, ENU order, symmetric, finite, positive semi-definite (tiny negative eigenvalues count
/// as 0).
ErrorEllipse error_ellipse(const Eigen::Matrix3d& covariance_m2);

}  // namespace anchord
