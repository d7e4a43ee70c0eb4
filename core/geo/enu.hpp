#pragma once

#include <Eigen/Core>

#include "core/types/position.hpp"

namespace anchord {

/// Earth-centred, earth-fixed metres of WGS84. `at` must have finite members, |lat_deg| <= 90.
/// Accuracy: GeographicLib's, about 5 nm near the surface.
Eigen::Vector3d ecef_from_wgs84(const Wgs84& at);
/// Inverse of ecef_from_wgs84; longitude in [-180, 180].
Wgs84 wgs84_from_ecef(const Eigen::Vector3d& ecef_m);

/// East-north-up tangent frame at one origin. An exact rotation and shift of ECEF, not a small-area formula:
/// nothing is lost 20 km from the origin. Pure values; safe to use from any thread.
class EnuFrame {
 public:
  explicit EnuFrame(const Wgs84& origin);
  const Wgs84& origin() const { return origin_; }
  Enu enu_from_wgs84(const Wgs84& at) const;
  Wgs84 wgs84_from_enu(const Enu& at) const;
  /// Rows are the east, north and up axes in ECEF.
  const Eigen::Matrix3d& enu_from_ecef() const { return enu_from_ecef_; }
  /// Covariance (m^2) turned into the axes of another origin: what "east" is changes with the place.
  Eigen::Matrix3d covariance_in(const EnuFrame& other, const Eigen::Matrix3d& covariance_m2) const;

 private:
  Wgs84 origin_;
  Eigen::Vector3d origin_ecef_m_;
  Eigen::Matrix3d enu_from_ecef_;
};

}  // namespace anchord
