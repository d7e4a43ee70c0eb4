#include "api/places/structure_json.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/types/wall.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

/// 1e-9 degrees are a tenth of a millimetre.
double rounded(double degrees) { return std::round(degrees * 1e9) / 1e9; }

/// A position of GeoJSON, height left out or ignored; nothing where it is none.
bool is_position(const Json& j) {
  if (!j.is_array() || j.size() < 2 || j.size() > 3 || !j[0].is_number() || !j[1].is_number()) return false;
  const double lon = j[0].get<double>(), lat = j[1].get<double>();
  return std::abs(lon) <= 180 && std::abs(lat) <= 90;
}

/// GeoJSON Polygon with one ring, closed.
bool is_polygon(const Json& j) {
  if (!j.is_object() || j.value("type", Json()) != "Polygon" || !j.contains("coordinates")) return false;
  const auto& rings = j["coordinates"];
  if (!rings.is_array() || rings.size() != 1 || !rings[0].is_array()) return false;
  const auto& ring = rings[0];
  if (ring.size() < 4 || ring.size() > 2000 || !std::all_of(ring.begin(), ring.end(), is_position))
    return false;
  return ring.front() == ring.back();
}

Ordered read_wall(const Json& body, const std::string& at, std::vector<FieldError>& errors) {
  Fields fields(body, at, errors);
  Ordered out;
  for (const char* end : {"from", "to"}) {
    const Json* position = fields.child(end);
    if (position != nullptr && is_position(*position))
      out[end] = {(*position)[0], (*position)[1]};
    else
      fields.error(end, "wrong_type", "must be [lon, lat] in degrees");
  }
  out["thickness_m"] = fields.number("thickness_m", 0.01, 3).value_or(0.1);
  out["material"] = fields.word("material", k_wall_material_words.words()).value_or("unknown");
  fields.finish();
  return out;
}

}  // namespace

Ordered proposal_json(const Json& traced, const Wgs84& origin) {
  const EnuFrame frame(origin);
  const auto degrees = [&](const Json& m) -> Ordered {
    const auto at = frame.wgs84_from_enu(Enu{{m.at(0).get<double>(), m.at(1).get<double>(), 0}});
    return {rounded(at.lon_deg), rounded(at.lat_deg)};
  };
  Ordered ring = Ordered::array();
  for (const auto& corner : traced.at("outline_m")) ring.push_back(degrees(corner));
  if (!ring.empty()) ring.push_back(ring.front());
  Ordered walls = Ordered::array();
  for (const auto& wall : traced.at("walls"))
    walls.push_back({{"from", degrees(wall.at("from_m"))},
                     {"to", degrees(wall.at("to_m"))},
                     {"thickness_m", std::round(wall.at("thickness_m").get<double>() * 1000) / 1000}});
  return {{"outline", {{"type", "Polygon"}, {"coordinates", Ordered::array({std::move(ring)})}}},
          {"walls", std::move(walls)},
          {"cell_m", traced.at("cell_m")},
          {"notes", traced.at("notes")}};
}

AcceptedStructure read_structure(const Json& body, const Document& proposal) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  AcceptedStructure out;
  Ordered structure{{"outline", nullptr}, {"walls", Ordered::array()}};
  const bool from_trace = fields.boolean("from_trace").value_or(false);
  out.site_outline = fields.boolean("site_outline").value_or(false);
  const auto material = fields.word("material", k_wall_material_words.words());
  if (from_trace) {
    const auto kept = kept_json(proposal.text);
    if (!kept.is_object()) {
      fields.error("from_trace", "bad_value", "the plan was not traced: POST .../plan/trace first");
    } else {
      structure["outline"] = kept.value("outline", Ordered());
      structure["walls"] = kept.value("walls", Ordered::array());
      for (auto& wall : structure["walls"]) wall["material"] = material.value_or("unknown");
    }
  }
  if (const Json* outline = fields.child("outline")) {
    if (is_polygon(*outline))
      structure["outline"] = *outline;
    else
      fields.error("outline", "wrong_type",
                   "must be a GeoJSON Polygon of one closed ring, at most 2000 corners");
  }
  if (const Json* walls = fields.child("walls")) {
    structure["walls"] = Ordered::array();
    if (!walls->is_array() || walls->size() > k_max_walls) {
      fields.error("walls", "wrong_type",
                   "must be an array of at most " + std::to_string(k_max_walls) + " walls");
    } else {
      for (std::size_t i = 0; i < walls->size() && errors.size() < 20; ++i)
        structure["walls"].push_back(read_wall((*walls)[i], "/walls/" + std::to_string(i), errors));
    }
  }
  fields.finish();
  refuse_if_any(errors);
  if (structure["outline"].is_object()) out.outline = {to_wire(structure["outline"])};
  out.structure = {to_wire(structure)};
  return out;
}

}  // namespace anchord::api
