#include "api/wire/outline_json.hpp"

#include "core/geo/enu.hpp"

namespace anchord::api {

std::vector<Eigen::Vector2d> outline_in_enu(const GeoRings& rings, const Wgs84& origin) {
  std::vector<Eigen::Vector2d> out;
  if (rings.empty()) return out;
  const EnuFrame frame(origin);
  for (const auto& at : rings.front())
    out.emplace_back(frame.enu_from_wgs84({at.lat_deg, at.lon_deg, origin.height_m}).m.head<2>());
  return out;
}

}  // namespace anchord::api
