#include "api/imports/outline_geojson.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "api/json/reader.hpp"
#include "core/geo/enu.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using LonLat = Eigen::Vector2d;

/// Members that GeoJSON allows beside ours are left alone (RFC 7946 section 6.1), so unknown ones are no
/// error here.
class Reader {
 public:
  explicit Reader(std::vector<FieldError>& errors) : errors_(errors) {}

  struct Area {
    std::vector<LonLat> corners;
    std::string kind;
    std::string at;
    std::optional<double> height_m;
  };
  std::vector<Area> areas;

  void object(const Json& json, const std::string& at, const Json* properties) {
    if (!json.is_object()) return fail(at, "wrong_type", "must be a GeoJSON object");
    const auto type =
        json.value("type", Json()).is_string() ? json["type"].get<std::string>() : std::string();
    if (type == "FeatureCollection") {
      const auto features = json.find("features");
      if (features == json.end() || !features->is_array())
        return fail(at + "/features", "required", "must be an array");
      for (std::size_t i = 0; i < features->size(); ++i) {
        object((*features)[i], at + "/features/" + std::to_string(i), nullptr);
      }
    } else if (type == "Feature") {
      const auto geometry = json.find("geometry");
      if (geometry == json.end()) return fail(at + "/geometry", "required", "a feature needs a geometry");
      const auto found = json.find("properties");
      object(*geometry, at + "/geometry", found != json.end() && found->is_object() ? &*found : nullptr);
    } else if (type == "Polygon") {
      polygon(json, at, properties);
    } else {
      fail(at + "/type", "unknown_value", "must be FeatureCollection, Feature or Polygon");
    }
  }

 private:
  void polygon(const Json& json, const std::string& at, const Json* properties) {
    Area area;
    area.at = at;
    if (properties != nullptr) read_properties(*properties, at, area);
    const auto rings = json.find("coordinates");
    if (rings == json.end() || !rings->is_array() || rings->empty() || !(*rings)[0].is_array()) {
      return fail(at + "/coordinates", "required", "must be an array of rings of [lon, lat]");
    }
    const Json& ring = (*rings)[0];  // holes (courtyards) are not flown into
    if (ring.size() < 3 || ring.size() > 10'000)
      return fail(at + "/coordinates/0", "out_of_range", "needs 3 to 10000 corners");
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const auto& p = ring[i];
      const std::string here = at + "/coordinates/0/" + std::to_string(i);
      if (!p.is_array() || p.size() < 2 || !p[0].is_number() || !p[1].is_number()) {
        return fail(here, "wrong_type", "must be [lon, lat] in degrees");
      }
      const LonLat corner{p[0].get<double>(), p[1].get<double>()};
      if (!(std::abs(corner.x()) <= 180) || !(std::abs(corner.y()) <= 90)) {
        return fail(here, "out_of_range",
                    "longitude -180..180, latitude -90..90 (GeoJSON has longitude first)");
      }
      if (area.corners.empty() || corner != area.corners.back()) area.corners.push_back(corner);
    }
    if (area.corners.size() > 1 && area.corners.front() == area.corners.back()) area.corners.pop_back();
    if (area.corners.size() < 3)
      return fail(at + "/coordinates/0", "out_of_range", "needs 3 different corners");
    areas.push_back(std::move(area));
  }

  void read_properties(const Json& properties, const std::string& at, Area& area) {
    const std::string base = at.substr(0, at.rfind('/')) + "/properties/";
    if (const auto kind = properties.find("kind"); kind != properties.end() && !kind->is_null()) {
      if (!kind->is_string()) return fail(base + "kind", "wrong_type", "must be a text");
      area.kind = kind->get<std::string>();
    }
    if (const auto height = properties.find("height_m"); height != properties.end() && !height->is_null()) {
      if (!height->is_number() || !(height->get<double>() > 0 && height->get<double>() <= 500)) {
        return fail(base + "height_m", "out_of_range", "must be a height above 0 and at most 500 m");
      }
      area.height_m = height->get<double>();
    }
  }

  void fail(std::string at, std::string code, std::string detail) {
    errors_.push_back({std::move(at), std::move(code), std::move(detail)});
  }
  std::vector<FieldError>& errors_;
};

}  // namespace

std::optional<OutlineRequest> read_outline(std::string_view text, std::vector<FieldError>& errors) {
  Json json;
  if (const auto broken = parse_json(text, json)) {
    errors.push_back(*broken);
    return std::nullopt;
  }
  Reader reader(errors);
  reader.object(json, "", nullptr);
  const Reader::Area* outline = nullptr;
  for (const auto& area : reader.areas) {
    if (area.kind == "no_fly" || area.kind == "fence") continue;
    if (outline != nullptr) {
      errors.push_back(
          {area.at, "conflict", "a second building outline; mark other areas with kind no_fly or fence"});
    } else {
      outline = &area;
    }
  }
  if (outline == nullptr && errors.empty())
    errors.push_back({"", "required", "no Polygon with the building's outline"});
  if (!errors.empty()) return std::nullopt;

  OutlineRequest out;
  LonLat middle{0, 0};
  for (const auto& corner : outline->corners) middle += corner / static_cast<double>(outline->corners.size());
  out.origin = {middle.y(), middle.x(), 0};
  const EnuFrame frame(out.origin);
  const auto metres = [&](const std::vector<LonLat>& corners) {
    planning::Polygon polygon;
    for (const auto& c : corners) polygon.push_back(frame.enu_from_wgs84({c.y(), c.x(), 0}).m.head<2>());
    return polygon;
  };
  out.input.outline = metres(outline->corners);
  if (outline->height_m) out.input.building_height_m = *outline->height_m;
  for (const auto& area : reader.areas) {
    if (area.kind == "no_fly") out.input.no_fly.push_back(metres(area.corners));
    if (area.kind == "fence") out.input.fence = metres(area.corners);
  }
  return out;
}

}  // namespace anchord::api
