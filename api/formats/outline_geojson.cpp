#include "api/formats/outline_geojson.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "api/formats/area_kind.hpp"
#include "api/kit/reader.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Corner = Eigen::Vector2d;  // longitude, latitude

/// Members that GeoJSON allows beside ours are left alone (RFC 7946 section 6.1), so unknown ones are no
/// error here.
class OutlineReader {
 public:
  explicit OutlineReader(std::vector<FieldError>& errors) : errors_(errors) {}

  struct Area {
    std::vector<Corner> corners;
    std::optional<AreaKind> kind;
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
      inside_ = true;  // points and lines beside the building are nobody's mistake
      for (std::size_t i = 0; i < features->size(); ++i) {
        object((*features)[i], at + "/features/" + std::to_string(i), nullptr);
      }
    } else if (type == "Feature") {
      const auto geometry = json.find("geometry");
      if (geometry == json.end()) return fail(at + "/geometry", "required", "a feature needs a geometry");
      const auto found = json.find("properties");
      object(*geometry, at + "/geometry", found != json.end() && found->is_object() ? &*found : nullptr);
    } else if (type == "GeometryCollection") {
      const auto parts = json.find("geometries");
      if (parts == json.end() || !parts->is_array())
        return fail(at + "/geometries", "required", "must be an array");
      for (std::size_t i = 0; i < parts->size(); ++i)
        object((*parts)[i], at + "/geometries/" + std::to_string(i), properties);
    } else if (type == "Polygon" || type == "MultiPolygon") {
      polygons(json, at, properties, type == "MultiPolygon");
    } else if (!inside_ || (type != "Point" && type != "MultiPoint" && type != "LineString" &&
                            type != "MultiLineString")) {
      fail(at + "/type", "unknown_value", "must be FeatureCollection, Feature, Polygon or MultiPolygon");
    }
  }

 private:
  void polygons(const Json& json, const std::string& at, const Json* properties, bool many) {
    Area area;
    area.at = at;
    if (properties != nullptr) read_properties(*properties, at, area);
    const auto coordinates = json.find("coordinates");
    if (coordinates == json.end() || !coordinates->is_array() || coordinates->empty())
      return fail(at + "/coordinates", "required", "must be an array of rings of [lon, lat]");
    if (!many) return polygon(*coordinates, at + "/coordinates", std::move(area));
    if (area.kind == AreaKind::fence && coordinates->size() > 1)
      return fail(at, "conflict", "a fence of several parts: draw one polygon round them");
    std::vector<Corner> all;
    const std::size_t wrong = errors_.size();
    for (std::size_t i = 0; i < coordinates->size(); ++i) {
      polygon((*coordinates)[i], at + "/coordinates/" + std::to_string(i), area);
      if (errors_.size() > wrong) continue;
      all.insert(all.end(), areas.back().corners.begin(), areas.back().corners.end());
      // Areas to keep out of stay apart; a building of several parts is flown round as one.
      if (area.kind != AreaKind::no_fly && coordinates->size() > 1) areas.pop_back();
    }
    if (errors_.size() > wrong || area.kind == AreaKind::no_fly || coordinates->size() == 1) return;
    area.corners = hull(std::move(all));
    areas.push_back(std::move(area));
  }

  /// Andrew's monotone chain.
  static std::vector<Corner> hull(std::vector<Corner> points) {
    std::sort(points.begin(), points.end(), [](const Corner& a, const Corner& b) {
      return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
    });
    std::vector<Corner> out;
    for (int pass = 0; pass < 2; ++pass) {
      const std::size_t begin = out.size();
      for (const auto& p : points) {
        while (out.size() >= begin + 2) {
          const Corner u = out.back() - out[out.size() - 2], v = p - out.back();
          if (u.x() * v.y() - u.y() * v.x() > 0) break;
          out.pop_back();
        }
        out.push_back(p);
      }
      out.pop_back();
      std::reverse(points.begin(), points.end());
    }
    return out;
  }

  void polygon(const Json& rings, const std::string& at, Area area) {
    if (!rings.is_array() || rings.empty() || !rings[0].is_array()) {
      return fail(at, "required", "must be an array of rings of [lon, lat]");
    }
    if (area.kind == AreaKind::fence && rings.size() > 1)
      return fail(at, "conflict", "a fence with holes: draw each hole as an area of its own, kind no_fly");
    const Json& ring = rings[0];  // holes (courtyards) are not flown into
    if (ring.size() < 3 || ring.size() > 10'000)
      return fail(at + "/0", "out_of_range", "needs 3 to 10000 corners");
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const auto& p = ring[i];
      const std::string here = at + "/0/" + std::to_string(i);
      if (!p.is_array() || p.size() < 2 || !p[0].is_number() || !p[1].is_number()) {
        return fail(here, "wrong_type", "must be [lon, lat] in degrees");
      }
      Corner corner{p[0].get<double>(), p[1].get<double>()};
      if (!(std::abs(corner.x()) <= 180) || !(std::abs(corner.y()) <= 90)) {
        return fail(here, "out_of_range",
                    "longitude -180..180, latitude -90..90 (GeoJSON has longitude first)");
      }
      // Over the date line a building goes on beyond 180 degrees.
      if (!first_lon_) first_lon_ = corner.x();
      if (corner.x() - *first_lon_ > 180) corner.x() -= 360;
      if (corner.x() - *first_lon_ < -180) corner.x() += 360;
      if (area.corners.empty() || corner != area.corners.back()) area.corners.push_back(corner);
    }
    if (area.corners.size() > 1 && area.corners.front() == area.corners.back()) area.corners.pop_back();
    if (area.corners.size() < 3) return fail(at + "/0", "out_of_range", "needs 3 different corners");
    if (planning::crosses_itself(area.corners))
      return fail(at + "/0", "self_crossing", "the ring crosses itself; give the corners in order round it");
    areas.push_back(std::move(area));
  }

  void read_properties(const Json& properties, const std::string& at, Area& area) {
    const std::string base = at.substr(0, at.rfind('/')) + "/properties/";
    if (const auto kind = properties.find("kind"); kind != properties.end() && !kind->is_null()) {
      if (!kind->is_string()) return fail(base + "kind", "wrong_type", "must be a string");
      area.kind = area_kind(kind->get_ref<const std::string&>());
      if (!area.kind && *kind != "")
        return fail(base + "kind", "unknown_value",
                    "must be outline, no_fly or fence, not " + to_utf8(to_wire(*kind), 60));
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
  bool inside_{false};
  std::optional<double> first_lon_;
};

}  // namespace

std::optional<OutlineRequest> read_outline(std::string_view text, std::vector<FieldError>& errors) {
  Json json;
  if (const auto broken = parse_json(text, json)) {
    errors.push_back(*broken);
    return std::nullopt;
  }
  OutlineReader reader(errors);
  reader.object(json, "", nullptr);
  const OutlineReader::Area* outline = nullptr;
  bool fenced = false;
  for (const auto& area : reader.areas) {
    if (area.kind == AreaKind::fence && std::exchange(fenced, true))
      errors.push_back({area.at, "conflict", "a second fence: draw one polygon round both"});
    if (bounds_flight(area.kind)) continue;
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
  Corner middle{0, 0};
  for (const auto& corner : outline->corners) middle += corner / static_cast<double>(outline->corners.size());
  out.origin = {middle.y(), std::remainder(middle.x(), 360.0), 0};
  const EnuFrame frame(out.origin);
  const auto metres = [&](const std::vector<Corner>& corners) {
    planning::Polygon polygon;
    for (const auto& c : corners) polygon.push_back(frame.enu_from_wgs84({c.y(), c.x(), 0}).m.head<2>());
    return polygon;
  };
  out.input.outline = metres(outline->corners);
  if (outline->height_m) out.input.building_height_m = *outline->height_m;
  for (const auto& area : reader.areas) {
    if (area.kind == AreaKind::no_fly) out.input.no_fly.push_back(metres(area.corners));
    if (area.kind == AreaKind::fence) out.input.fence = metres(area.corners);
  }
  return out;
}

}  // namespace anchord::api
