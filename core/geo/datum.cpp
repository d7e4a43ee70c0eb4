#include "core/geo/datum.hpp"

#include <Eigen/Geometry>
#include <numbers>

#include "core/geo/enu.hpp"

namespace anchord {

Eigen::Vector3d DatumChange::ecef_m(const Eigen::Vector3d& before_ecef_m) const {
  const Eigen::Vector3d r_rad = rotation_arcsec * std::numbers::pi / (180.0 * 3600.0);
  return translation_m + (1.0 + 1e-6 * scale_ppm) * (before_ecef_m + r_rad.cross(before_ecef_m));
}

Wgs84 DatumChange::wgs84(const Wgs84& before) const {
  return wgs84_from_ecef(ecef_m(ecef_from_wgs84(before)));
}

DatumChange datum_change_between(const Wgs84& before, const Wgs84& after) {
  return {ecef_from_wgs84(after) - ecef_from_wgs84(before), {0, 0, 0}, 0};
}

DatumChange datum_change_at(const Wgs84& place, const Eigen::Vector3d& enu_m) {
  return {EnuFrame(place).enu_from_ecef().transpose() * enu_m, {0, 0, 0}, 0};
}

}  // namespace anchord
