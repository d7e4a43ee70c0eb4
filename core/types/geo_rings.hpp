#pragma once

#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/types/plan.hpp"

namespace anchord {

/// A polygon on the globe as GeoJSON has it: the outer ring, then its holes, each with the corners it was
/// given, closed or not. Empty: there is none.
using GeoRings = std::vector<std::vector<LonLat>>;

/// The GeoJSON Polygon of these rings; null where there are none. A template, as to_wire, so that this folder
/// needs no JSON library.
template <class Json>
Json polygon_of(const GeoRings& rings) {
  if (rings.empty()) return nullptr;
  Json coordinates = Json::array();
  for (const auto& ring : rings) {
    Json corners = Json::array();
    for (const auto& p : ring) corners.push_back(Json::array({p.lon_deg, p.lat_deg}));
    coordinates.push_back(std::move(corners));
  }
  return {{"type", "Polygon"}, {"coordinates", std::move(coordinates)}};
}

/// The rings of a GeoJSON Polygon, whatever their number and length; heights of corners are left out.
/// errors  none: it is no Polygon; `wrong` is then the JSON pointer of what is amiss in it
template <class Json>
std::optional<GeoRings> rings_of(const Json& polygon, std::string& wrong) {
  wrong.clear();
  if (!polygon.is_object() || polygon.value("type", Json()) != "Polygon" || !polygon.contains("coordinates"))
    return std::nullopt;
  const auto& coordinates = polygon["coordinates"];
  wrong = "/coordinates";
  if (!coordinates.is_array()) return std::nullopt;
  GeoRings out;
  for (const auto& corners : coordinates) {
    wrong = "/coordinates/" + std::to_string(out.size());
    if (!corners.is_array()) return std::nullopt;
    auto& ring = out.emplace_back();
    for (const auto& p : corners) {
      const bool pair = p.is_array() && p.size() >= 2 && p[0].is_number() && p[1].is_number();
      if (!pair || !(std::abs(p[1].template get<double>()) <= 90)) {
        wrong += '/' + std::to_string(ring.size());
        return std::nullopt;
      }
      ring.push_back({p[0].template get<double>(), p[1].template get<double>()});
    }
  }
  wrong.clear();
  return out;
}

}  // namespace anchord
