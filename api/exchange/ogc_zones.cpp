#include "api/exchange/ogc_zones.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "core/ports/place_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_page = 20;  // the documents of a floor may be some megabytes

/// The outer ring alone: holes are not asked for where outlines are accepted.
Ordered outline_of(const Floor& floor) {
  const auto kept = kept_json(floor.structure.text);
  if (!kept.is_object() || !kept.contains("outline") || !kept["outline"].is_object()) return nullptr;
  return kept["outline"];
}

}  // namespace

Ordered zone_json(const Floor& floor, const Building& building) {
  Ordered out{{"type", "Feature"}, {"id", to_string(floor.id)}, {"geometry", outline_of(floor)}};
  out["properties"] = {{"name", floor.name},
                       {"level", floor.level},
                       {"base_height_m", or_null(floor.base_height_m)},
                       {"building", building.name},
                       {"building_id", to_string(building.id)},
                       {"building_height_m", or_null(building.height_m)},
                       {"site", to_string(building.site)},
                       {"created_at", to_rfc3339(floor.created)}};
  return out;
}

Result<void> each_zone(PlaceStore& places, const std::function<void(const Floor&, const Building&)>& take) {
  for (std::optional<BuildingId> after;;) {
    BOOST_OUTCOME_TRY(const auto buildings, places.buildings(k_page, after, std::nullopt));
    for (const auto& building : buildings) {
      for (std::optional<FloorId> below;;) {
        BOOST_OUTCOME_TRY(const auto floors, places.floors(k_page, below, building.id));
        for (const auto& floor : floors) take(floor, building);
        if (floors.size() < k_page) break;
        below = floors.back().id;
      }
    }
    if (buildings.size() < k_page) return boost::outcome_v2::success();
    after = buildings.back().id;
  }
}

std::optional<LonLatBox> bounds_of(const Ordered& zone) {
  const auto& geometry = zone.at("geometry");
  if (!geometry.is_object()) return std::nullopt;
  LonLatBox out{180, 90, -180, -90};
  for (const auto& corner : geometry.at("coordinates").at(0)) {
    const double lon = corner.at(0), lat = corner.at(1);
    out = {std::min(out.west, lon), std::min(out.south, lat), std::max(out.east, lon),
           std::max(out.north, lat)};
  }
  return out;
}

}  // namespace anchord::api
