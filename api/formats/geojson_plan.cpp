#include "api/formats/geojson_plan.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "api/formats/area_kind.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

constexpr std::size_t k_most_features = 2000, k_most_notes = 100;
constexpr double k_most_height_m = 500;

std::string small_letters(std::string_view text) {
  std::string out;
  for (const char c : text) out += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

const Json* member(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto it = object.find(key);
  return it == object.end() || it->is_null() ? nullptr : &*it;
}

std::optional<LonLat> lon_lat(const Json& place) {
  if (!place.is_array() || place.size() < 2 || !place[0].is_number() || !place[1].is_number())
    return std::nullopt;
  const LonLat out{place[0].get<double>(), place[1].get<double>()};
  if (!(std::abs(out.lon_deg) <= 180) || !(std::abs(out.lat_deg) <= 90)) return std::nullopt;
  return out;
}

class FeatureReader {
 public:
  FeatureReader(std::vector<std::string>& notes, std::vector<FieldError>& errors)
      : notes_(notes), errors_(errors) {}

  Plan plan;

  void feature(const Json& json, std::size_t index) {
    at_ = "/features/" + std::to_string(index);
    properties_ = member(json, "properties");
    const Json* geometry = member(json, "geometry");
    if (geometry == nullptr) return fail("/geometry", "required", "must be a GeoJSON geometry");
    if (!read_kind()) return;
    shape(*geometry, "/geometry");
  }

 private:
  void fail(const std::string& below, const char* code, std::string detail) {
    if (errors_.size() < 100) errors_.push_back({at_ + below, code, std::move(detail)});
  }
  void note(std::string text) {
    if (notes_.size() < k_most_notes) notes_.push_back(at_ + ' ' + std::move(text));
  }
  /// Programs write their names of fields large or small.
  const Json* property(std::string_view name) const {
    if (properties_ == nullptr || !properties_->is_object()) return nullptr;
    for (const auto& [key, value] : properties_->items())
      if (!value.is_null() && small_letters(key) == name) return &value;
    return nullptr;
  }

  /// False where the feature says a kind that we do not know (reported).
  bool read_kind() {
    kind_.reset();
    const Json* given = property("kind");
    if (given == nullptr || *given == "") return true;
    if (given->is_string()) kind_ = area_kind(given->get_ref<const std::string&>());
    if (kind_) return true;
    fail("/properties/kind", "unknown_value",
         "must be " + std::string(k_area_kinds) + ", not " + to_utf8(to_wire(*given), 60));
    return false;
  }

  /// The kind that another property of a polygon without one says.
  bool says_bound_elsewhere() {
    if (kind_ || properties_ == nullptr || !properties_->is_object()) return false;
    for (const auto& [key, value] : properties_->items()) {
      if (!value.is_string() || !bounds_flight(area_kind_in(value.get_ref<const std::string&>()))) continue;
      fail("/properties/kind", "required",
           "is missing, and " + to_utf8(key, 60) + " is " + to_utf8(value.get<std::string>(), 60) +
               ": give kind fence or no_fly, or kind outline where it is the building");
      return true;
    }
    return false;
  }

  void shape(const Json& geometry, const std::string& below) {
    const Json *type = member(geometry, "type"), *coordinates = member(geometry, "coordinates"),
               *parts = member(geometry, "geometries");
    if (type == nullptr || !type->is_string()) return fail(below, "required", "must be a GeoJSON geometry");
    const auto& word = type->get_ref<const std::string&>();
    if (word == "GeometryCollection" && parts != nullptr && parts->is_array()) {
      for (std::size_t i = 0; i < parts->size(); ++i) {
        const Json* inner = member((*parts)[i], "type");
        const auto here = below + "/geometries/" + std::to_string(i);
        if (inner != nullptr && *inner == "GeometryCollection")
          fail(here, "unknown_value", "is a collection within a collection: take it apart");
        else
          shape((*parts)[i], here);
      }
      return;
    }
    if (coordinates == nullptr || !coordinates->is_array())
      return fail(below, "required", "must be a GeoJSON geometry");
    const auto within = below + "/coordinates";
    if (word == "Point")
      waypoint(*coordinates, within);
    else if (word == "MultiPoint")
      for (std::size_t i = 0; i < coordinates->size(); ++i)
        waypoint((*coordinates)[i], within + '/' + std::to_string(i));
    else if (word == "Polygon")
      polygon(*coordinates, within);
    else if (word == "MultiPolygon")
      polygons(*coordinates, within);
    else if (word == "LineString" || word == "MultiLineString")
      line(word);
    else
      fail(below + "/type", "unknown_value",
           "must be Polygon, MultiPolygon, Point or MultiPoint, not " + to_utf8(word, 60));
  }

  void line(const std::string& type) {
    if (kind_ == AreaKind::path) return;  // of our own export, beside the waypoints
    if (!kind_) return note("is a " + type + " and was left out: waypoints are points");
    fail("/geometry/type", "wrong_type",
         bounds_flight(kind_) || kind_ == AreaKind::outline
             ? "is a " + type + ", which bounds no area: close it and make a Polygon of it"
             : "is a " + type + ": make a Point of each waypoint, with height_above_ground_m");
  }

  void waypoint(const Json& place, const std::string& below) {
    if (kind_ == AreaKind::outline || bounds_flight(kind_))
      return fail(below, "wrong_type", "is a point, which bounds no area: make a Polygon of it");
    const auto at = lon_lat(place);
    const Json *height = property("height_above_ground_m"), *heading = property("heading_deg");
    if (!at || height == nullptr || !height->is_number() ||
        !(height->get<double>() >= 0 && height->get<double>() <= k_most_height_m)) {
      return fail("", "required", "a waypoint needs [lon, lat] and height_above_ground_m of 0 to 500 m");
    }
    if (heading != nullptr && !heading->is_number())
      return fail("/properties/heading_deg", "wrong_type", "must be a number of degrees");
    PlanWaypoint w;
    w.at = *at;
    w.height_m = height->get<double>();
    if (heading != nullptr) w.heading_deg = std::fmod(std::fmod(heading->get<double>(), 360) + 360, 360);
    w.measure = kind_ != AreaKind::transit;
    plan.waypoints.push_back(w);
  }

  void polygons(const Json& parts, const std::string& below) {
    if (parts.empty()) return fail(below, "required", "has no polygon");
    if (parts.size() > 1 && kind_ != AreaKind::no_fly) {
      const auto n = std::to_string(parts.size());
      return fail(below, "conflict",
                  kind_ == AreaKind::fence
                      ? "a fence of " + n +
                            " parts: a plan has one fence, so draw one polygon round them, and "
                            "what is not to be flown over in it as no_fly"
                      : "an outline of " + n + " parts: draw one polygon round them");
    }
    for (std::size_t i = 0; i < parts.size(); ++i) polygon(parts[i], below + '/' + std::to_string(i));
  }

  void polygon(const Json& rings, const std::string& below) {
    if (says_bound_elsewhere()) return;
    if (kind_ && !bounds_flight(kind_) && kind_ != AreaKind::outline) {
      return fail("/properties/kind", "wrong_type",
                  "is that of a point or a line, but this is a Polygon: give outline, no_fly or fence");
    }
    if (!rings.is_array() || rings.empty() || !rings[0].is_array())
      return fail(below, "required", "must be an array of rings of [lon, lat]");
    GeoPolygon area;
    for (const auto& corner : rings[0]) {
      const auto p = lon_lat(corner);
      if (!p) return fail(below + "/0", "out_of_range", "must be [lon, lat] in degrees");
      if (area.empty() || !(*p == area.back())) area.push_back(*p);
    }
    if (area.size() > 1 && area.front() == area.back()) area.pop_back();
    if (area.size() < 3) return fail(below + "/0", "out_of_range", "needs 3 different corners");
    const bool holes = rings.size() > 1;
    if (kind_ == AreaKind::no_fly) {
      if (holes) note("has holes: the whole of the no-fly area is kept out of");
      plan.no_fly.push_back(std::move(area));
    } else if (kind_ == AreaKind::fence) {
      fence(std::move(area), below, holes);
    } else {
      outline(std::move(area), holes);
    }
  }

  void fence(GeoPolygon area, const std::string& below, bool holes) {
    if (holes)
      return fail(below, "conflict", "a fence with holes: draw each hole as an area of its own, kind no_fly");
    if (!plan.fence.empty())
      return fail("", "conflict", "a second fence: a plan has one, so draw one polygon round both");
    plan.fence = std::move(area);
  }

  void outline(GeoPolygon area, bool holes) {
    if (!plan.outline.empty())
      return fail("", "conflict", "a second building outline; mark other areas with kind no_fly or fence");
    const Json* height = property("height_m");
    if (height != nullptr && (!height->is_number() || !(height->get<double>() >= 1) ||
                              !(height->get<double>() <= k_most_height_m))) {
      return fail(
          "/properties/height_m", "out_of_range",
          "must be a number, the height of the building, 1 to 500 m, not " + to_utf8(to_wire(*height), 60));
    }
    if (holes) note("has courtyards, which are not flown into");
    if (height != nullptr) plan.building_height_m = height->get<double>();
    plan.outline = std::move(area);
  }

  std::vector<std::string>& notes_;
  std::vector<FieldError>& errors_;
  std::string at_;
  const Json* properties_{nullptr};
  std::optional<AreaKind> kind_{};
};

}  // namespace

Plan read_geojson_plan(const Json& file, std::vector<std::string>& notes, std::vector<FieldError>& errors) {
  const Json* features = member(file, "features");
  if (features == nullptr || !features->is_array() || features->size() > k_most_features) {
    errors.push_back({"/features", "required", "must be a FeatureCollection of at most 2000 features"});
    return {};
  }
  FeatureReader reader(notes, errors);
  for (std::size_t i = 0; i < features->size(); ++i) reader.feature((*features)[i], i);
  return std::move(reader.plan);
}

}  // namespace anchord::api
