#include "api/formats/floor_structure.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "api/kit/reader.hpp"

namespace anchord {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr double k_storey_m = 3;

double bottom_of(const Floor& floor) { return floor.base_height_m.value_or(floor.level * k_storey_m); }

std::optional<LonLat> position(const Ordered& j) {
  if (!j.is_array() || j.size() < 2 || !j[0].is_number() || !j[1].is_number()) return std::nullopt;
  const LonLat at{j[0].get<double>(), j[1].get<double>()};
  if (!(std::abs(at.lon_deg) <= 180) || !(std::abs(at.lat_deg) <= 90)) return std::nullopt;
  return at;
}

void add_wall(const Ordered& wall, const StoreyHeights& heights, SiteStructure& out) {
  if (!wall.is_object()) return;
  const auto from = position(wall.value("from", Ordered())), to = position(wall.value("to", Ordered()));
  if (!from || !to || *from == *to) return;
  GeoWall made{*from, *to, heights.bottom_m, heights.top_m};
  const auto thickness = wall.value("thickness_m", Ordered()), material = wall.value("material", Ordered());
  if (thickness.is_number()) made.thickness_m = std::clamp(thickness.get<double>(), 0.01, 3.0);
  if (material.is_string())
    made.material =
        k_wall_material_words.find(material.get_ref<const std::string&>()).value_or(WallMaterial::unknown);
  out.walls.push_back(made);
}

void add_outline(const Ordered& outline, SiteStructure& out) {
  if (!outline.is_object() || !outline.contains("coordinates")) return;
  const auto& rings = outline["coordinates"];
  if (!rings.is_array() || rings.empty() || !rings[0].is_array()) return;
  GeoPolygon polygon;
  for (const auto& corner : rings[0]) {
    const auto at = position(corner);
    if (!at) return;
    polygon.push_back(*at);
  }
  if (polygon.size() > 1 && polygon.front() == polygon.back()) polygon.pop_back();
  if (polygon.size() < 3 || std::ranges::find(out.outlines, polygon) != out.outlines.end()) return;
  out.outlines.push_back(std::move(polygon));
}

/// Metres, near enough to compare walls of one site.
double length_m(const GeoWall& wall) {
  constexpr double k_degree_m = 111'200;
  const double shrink = std::cos(wall.from.lat_deg * std::numbers::pi / 180);
  return k_degree_m *
         std::hypot((wall.to.lon_deg - wall.from.lon_deg) * shrink, wall.to.lat_deg - wall.from.lat_deg);
}

}  // namespace

StoreyHeights storey_heights(const Floor& floor, std::span<const Floor> of_building,
                             const Building& building) {
  constexpr double k_same_m = 0.5;  // half a floor's thickness: a gallery is no floor above
  StoreyHeights out{bottom_of(floor), 0};
  std::optional<double> above;
  for (const Floor& other : of_building) {
    const double bottom_m = bottom_of(other);
    if (bottom_m > out.bottom_m + k_same_m) above = std::min(above.value_or(bottom_m), bottom_m);
  }
  if (!above && building.height_m && *building.height_m > out.bottom_m) above = building.height_m;
  out.top_m = above.value_or(out.bottom_m + k_storey_m);
  return out;
}

void add_floor_structure(std::string_view structure_json, const StoreyHeights& heights, SiteStructure& out) {
  const auto kept = api::kept_json(structure_json);
  if (!kept.is_object()) return;
  if (kept.contains("outline")) add_outline(kept["outline"], out);
  if (!kept.contains("walls") || !kept["walls"].is_array()) return;
  for (const auto& wall : kept["walls"]) add_wall(wall, heights, out);
}

void keep_longest(SiteStructure& structure, std::size_t most) {
  if (structure.walls.size() <= most) return;
  const auto end = structure.walls.begin() + static_cast<std::ptrdiff_t>(most);
  std::ranges::nth_element(structure.walls, end,
                           [](const GeoWall& a, const GeoWall& b) { return length_m(a) > length_m(b); });
  structure.walls.erase(end, structure.walls.end());
}

}  // namespace anchord
