#include "core/localize/error_ellipse.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord {

ErrorEllipse error_ellipse(const Eigen::Matrix3d& covariance_m2) {
  // Quantiles of chi-square: 2 degrees of freedom -2 ln 0.05 = 5.9915; 1 degree 1.95996^2.
  constexpr double k_chi2_2_95 = 5.991464547107979;
  constexpr double k_normal_95 = 1.959963984540054;
  const double ee = covariance_m2(0, 0);
  const double nn = covariance_m2(1, 1);
  const double en = 0.5 * (covariance_m2(0, 1) + covariance_m2(1, 0));
  // Eigenvalues of a symmetric 2x2 in closed form.
  const double mean = 0.5 * (ee + nn);
  const double spread = std::hypot(0.5 * (ee - nn), en);
  ErrorEllipse ellipse;
  ellipse.major_m = std::sqrt(k_chi2_2_95 * std::max(mean + spread, 0.0));
  ellipse.minor_m = std::sqrt(k_chi2_2_95 * std::max(mean - spread, 0.0));
  const double from_east_rad = 0.5 * std::atan2(2.0 * en, ee - nn);
  double azimuth_deg = 90.0 - from_east_rad * 180.0 / std::numbers::pi;
  if (azimuth_deg >= 180.0) azimuth_deg -= 180.0;
  if (azimuth_deg < 0.0) azimuth_deg += 180.0;
  ellipse.azimuth_deg = azimuth_deg;
  ellipse.h95_m = ellipse.major_m;
  ellipse.v95_m = k_normal_95 * std::sqrt(std::max(covariance_m2(2, 2), 0.0));
  return ellipse;
}

}  // namespace anchord
