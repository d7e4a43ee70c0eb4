#include "api/wire/outline_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/geo/enu.hpp"

namespace anchord::api {

std::vector<Eigen::Vector2d> outline_in_enu(const std::string& geojson, const Wgs84& origin) {
  std::vector<Eigen::Vector2d> out;
  const auto json = nlohmann::json::parse(geojson, nullptr, false);
  if (!json.is_object() || !json.contains("coordinates") || !json["coordinates"].is_array() ||
      json["coordinates"].empty() || !json["coordinates"][0].is_array())
    return out;
  const EnuFrame frame(origin);
  for (const auto& at : json["coordinates"][0]) {
    if (!at.is_array() || at.size() < 2 || !at[0].is_number() || !at[1].is_number()) return {};
    const double lon = at[0].get<double>(), lat = at[1].get<double>();
    if (!(std::abs(lat) <= 90)) return {};
    out.emplace_back(frame.enu_from_wgs84({lat, lon, origin.height_m}).m.head<2>());
  }
  return out;
}

}  // namespace anchord::api
