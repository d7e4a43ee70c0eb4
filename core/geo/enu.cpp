#include "core/geo/enu.hpp"

#include <GeographicLib/Geocentric.hpp>
#include <vector>

namespace anchord {

Eigen::Vector3d ecef_from_wgs84(const Wgs84& at) {
  Eigen::Vector3d m;
  GeographicLib::Geocentric::WGS84().Forward(at.lat_deg, at.lon_deg, at.height_m, m.x(), m.y(), m.z());
  return m;
}

Wgs84 wgs84_from_ecef(const Eigen::Vector3d& ecef_m) {
  Wgs84 at;
  GeographicLib::Geocentric::WGS84().Reverse(ecef_m.x(), ecef_m.y(), ecef_m.z(), at.lat_deg, at.lon_deg,
                                             at.height_m);
  return at;
}

EnuFrame::EnuFrame(const Wgs84& origin) : origin_(origin) {
  // GeographicLib gives the rotation ECEF <- ENU, row-major.
  std::vector<double> rotation(9);
  GeographicLib::Geocentric::WGS84().Forward(origin.lat_deg, origin.lon_deg, origin.height_m,
                                             origin_ecef_m_.x(), origin_ecef_m_.y(), origin_ecef_m_.z(),
                                             rotation);
  enu_from_ecef_ = Eigen::Map<const Eigen::Matrix3d>(rotation.data());  // column-major read = transpose
}

Enu EnuFrame::enu_from_wgs84(const Wgs84& at) const {
  return {enu_from_ecef_ * (ecef_from_wgs84(at) - origin_ecef_m_)};
}

Wgs84 EnuFrame::wgs84_from_enu(const Enu& at) const {
  return wgs84_from_ecef(origin_ecef_m_ + enu_from_ecef_.transpose() * at.m);
}

Eigen::Matrix3d EnuFrame::covariance_in(const EnuFrame& other, const Eigen::Matrix3d& covariance_m2) const {
  const Eigen::Matrix3d other_from_this = other.enu_from_ecef_ * enu_from_ecef_.transpose();
  return other_from_this * covariance_m2 * other_from_this.transpose();
}

}  // namespace anchord
