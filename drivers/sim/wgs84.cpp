#include "drivers/sim/wgs84.hpp"

#include <cmath>

#include "core/base/angle.hpp"

namespace anchord::sim {
namespace {

// WGS84 ellipsoid, NGA.STND.0036.
constexpr double k_a_m = 6378137.0;
constexpr double k_f = 1.0 / 298.257223563;
constexpr double k_e2 = k_f * (2.0 - k_f);

Eigen::Vector3d ecef_m(const Wgs84& at) {
  const double lat = at.lat_deg * k_degree, lon = at.lon_deg * k_degree;
  const double n = k_a_m / std::sqrt(1.0 - k_e2 * std::sin(lat) * std::sin(lat));
  return {(n + at.height_m) * std::cos(lat) * std::cos(lon),
          (n + at.height_m) * std::cos(lat) * std::sin(lon),
          (n * (1.0 - k_e2) + at.height_m) * std::sin(lat)};
}

}  // namespace

Wgs84 wgs84_from_enu(const Wgs84& origin, const Eigen::Vector3d& enu_m) {
  const double lat0 = origin.lat_deg * k_degree, lon0 = origin.lon_deg * k_degree;
  const Eigen::Vector3d east(-std::sin(lon0), std::cos(lon0), 0);
  const Eigen::Vector3d north(-std::sin(lat0) * std::cos(lon0), -std::sin(lat0) * std::sin(lon0),
                              std::cos(lat0));
  const Eigen::Vector3d up(std::cos(lat0) * std::cos(lon0), std::cos(lat0) * std::sin(lon0), std::sin(lat0));
  const Eigen::Vector3d p = ecef_m(origin) + enu_m.x() * east + enu_m.y() * north + enu_m.z() * up;
  const double rho_m = std::hypot(p.x(), p.y());
  double lat = std::atan2(p.z(), rho_m * (1.0 - k_e2));
  double n = k_a_m;
  for (int i = 0; i < 8; ++i) {  // contracts by about 1/300 a turn: 8 turns are far below a nanometre
    n = k_a_m / std::sqrt(1.0 - k_e2 * std::sin(lat) * std::sin(lat));
    lat = std::atan2(p.z() + k_e2 * n * std::sin(lat), rho_m);
  }
  const double height_m = rho_m * std::cos(lat) + p.z() * std::sin(lat) - k_a_m * k_a_m / n;
  return {lat / k_degree, std::atan2(p.y(), p.x()) / k_degree, height_m};
}

}  // namespace anchord::sim
