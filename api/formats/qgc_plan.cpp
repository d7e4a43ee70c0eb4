#include "api/formats/qgc_plan.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "core/geo/enu.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

// MAV_CMD and MAV_FRAME of the MAVLink common set.
constexpr int k_waypoint = 16, k_return = 20, k_land = 21, k_takeoff = 22, k_yaw = 115;
constexpr int k_frame_msl = 0, k_frame_relative = 3, k_frame_mission = 2;
constexpr std::size_t k_max_items = 1000;

void fail(std::vector<FieldError>& errors, std::string at, const char* code, std::string detail) {
  errors.push_back({std::move(at), code, std::move(detail)});
}

std::optional<LonLat> lat_lon(const Json& lat, const Json& lon) {
  if (!lat.is_number() || !lon.is_number()) return std::nullopt;
  const LonLat out{lon.get<double>(), lat.get<double>()};
  if (!(std::abs(out.lon_deg) <= 180) || !(std::abs(out.lat_deg) <= 90)) return std::nullopt;
  return out;
}

const Json* member(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto it = object.find(key);
  return it == object.end() ? nullptr : &*it;
}

void read_polygons(const Json& fence, Plan& plan, std::vector<FieldError>& errors) {
  const Json* polygons = member(fence, "polygons");
  if (polygons == nullptr || !polygons->is_array()) return;
  for (std::size_t i = 0; i < polygons->size() && i < 100; ++i) {
    const std::string at = "/geoFence/polygons/" + std::to_string(i);
    const Json* corners = member((*polygons)[i], "polygon");
    if (corners == nullptr || !corners->is_array()) {
      fail(errors, at + "/polygon", "required", "must be an array of [lat, lon]");
      continue;
    }
    GeoPolygon area;
    for (const auto& corner : *corners) {
      const auto point =
          corner.is_array() && corner.size() >= 2 ? lat_lon(corner[0], corner[1]) : std::nullopt;
      if (!point) return fail(errors, at + "/polygon", "out_of_range", "must be [lat, lon] in degrees");
      area.push_back(*point);
    }
    if (area.size() < 3) return fail(errors, at + "/polygon", "out_of_range", "needs 3 corners");
    const Json* inclusion = member((*polygons)[i], "inclusion");
    if (inclusion != nullptr && *inclusion == true)
      plan.fence = std::move(area);
    else
      plan.no_fly.push_back(std::move(area));
  }
}

void read_circles(const Json& fence, Plan& plan, std::vector<FieldError>& errors) {
  const Json* circles = member(fence, "circles");
  if (circles == nullptr || !circles->is_array()) return;
  for (std::size_t i = 0; i < circles->size() && i < 100; ++i) {
    const Json* circle = member((*circles)[i], "circle");
    const Json* centre = circle ? member(*circle, "center") : nullptr;
    const Json* radius = circle ? member(*circle, "radius") : nullptr;
    const auto middle = centre != nullptr && centre->is_array() && centre->size() >= 2
                            ? lat_lon((*centre)[0], (*centre)[1])
                            : std::nullopt;
    if (!middle || radius == nullptr || !radius->is_number() || !(radius->get<double>() > 0)) {
      fail(errors, "/geoFence/circles/" + std::to_string(i), "wrong_type",
           "needs circle.center and circle.radius");
      continue;
    }
    const Json* inclusion = member((*circles)[i], "inclusion");
    const bool inside = inclusion != nullptr && *inclusion == true;
    // Corners so that the area is on the safe side: a fence inside the circle, a no-fly area round it.
    constexpr int k_corners = 24;
    const double r = radius->get<double>() / (inside ? 1 : std::cos(std::numbers::pi / k_corners));
    const EnuFrame frame({middle->lat_deg, middle->lon_deg, 0});
    GeoPolygon area;
    for (int c = 0; c < k_corners; ++c) {
      const double angle = 2 * std::numbers::pi * c / k_corners;
      const auto at = frame.wgs84_from_enu(Enu{{r * std::cos(angle), r * std::sin(angle), 0}});
      area.push_back({at.lon_deg, at.lat_deg});
    }
    if (inside)
      plan.fence = std::move(area);
    else
      plan.no_fly.push_back(std::move(area));
  }
}

struct Item {
  int command{}, frame{};
  const Json* params{};
};

/// Nothing: not a simple item, or one without the needed members (reported).
std::optional<Item> read_item(const Json& json, const std::string& at, std::vector<std::string>& notes,
                              std::vector<FieldError>& errors) {
  const Json* type = member(json, "type");
  if (type != nullptr && *type != "SimpleItem") {
    notes.push_back(at + " is a complex item (such as a survey) and was left out");
    return std::nullopt;
  }
  const Json *command = member(json, "command"), *frame = member(json, "frame"),
             *params = member(json, "params");
  if (command == nullptr || !command->is_number_integer() || params == nullptr || !params->is_array() ||
      params->size() != 7) {
    fail(errors, at, "required", "needs a command and seven params");
    return std::nullopt;
  }
  const int in_frame = frame != nullptr && frame->is_number_integer() ? frame->get<int>() : k_frame_relative;
  return Item{command->get<int>(), in_frame, params};
}

void read_waypoint(const Item& item, const std::string& at, double home_m, Plan& plan,
                   std::vector<FieldError>& errors) {
  const Json& p = *item.params;
  const auto place = lat_lon(p[4], p[5]);
  if (!place || !p[6].is_number()) {
    return fail(errors, at + "/params", "out_of_range", "a waypoint needs latitude, longitude and altitude");
  }
  PlanWaypoint w;
  w.at = *place;
  w.height_m = p[6].get<double>() - (item.frame == k_frame_msl ? home_m : 0);
  if (item.frame != k_frame_msl && item.frame != k_frame_relative) {
    return fail(errors, at + "/frame", "unknown_value",
                "altitudes must be relative to home (frame 3) or above sea level (frame 0)");
  }
  if (!(w.height_m >= 0 && w.height_m <= 500)) {
    return fail(errors, at + "/params/6", "out_of_range", "the height above home must be 0 to 500 m");
  }
  if (p[0].is_number() && p[0].get<double>() >= 0 && p[0].get<double>() <= 600) {
    w.measure = p[0].get<double>() > 0;
    if (w.measure) w.dwell_s = p[0].get<double>();
  }
  if (p[3].is_number()) w.heading_deg = std::fmod(std::fmod(p[3].get<double>(), 360) + 360, 360);
  plan.waypoints.push_back(w);
}

}  // namespace

Plan read_qgc_plan(const Json& file, std::vector<std::string>& notes, std::vector<FieldError>& errors) {
  Plan plan;
  const Json *mission = member(file, "mission"), *items = mission ? member(*mission, "items") : nullptr;
  if (items == nullptr || !items->is_array() || items->size() > k_max_items) {
    fail(errors, "/mission/items", "required", "must be an array of at most 1000 items");
    return plan;
  }
  double home_m = 0;
  const Json* home = member(*mission, "plannedHomePosition");
  if (home != nullptr && home->is_array() && home->size() == 3 && (*home)[2].is_number()) home_m = (*home)[2];
  const Json* speed = member(*mission, "hoverSpeed");
  if (speed != nullptr && speed->is_number() && speed->get<double>() >= 0.1 && speed->get<double>() <= 15) {
    plan.settings.speed_mps = speed->get<double>();
  }
  for (std::size_t i = 0; i < items->size(); ++i) {
    const std::string at = "/mission/items/" + std::to_string(i);
    const auto item = read_item((*items)[i], at, notes, errors);
    if (!item) continue;
    if (item->command == k_waypoint) {
      read_waypoint(*item, at, home_m, plan, errors);
    } else if (item->command == k_yaw) {
      if (!plan.waypoints.empty()) plan.waypoints.back().turn = true;
    } else if (item->command != k_takeoff && item->command != k_return && item->command != k_land) {
      notes.push_back(at + " has command " + std::to_string(item->command) +
                      ", which a calibration flight does not use");
    }
  }
  if (const Json* fence = member(file, "geoFence")) {
    read_polygons(*fence, plan, errors);
    read_circles(*fence, plan, errors);
  }
  return plan;
}

Plan read_geojson_plan(const Json& file, std::vector<FieldError>& errors) {
  Plan plan;
  const Json* features = member(file, "features");
  if (features == nullptr || !features->is_array()) {
    fail(errors, "/features", "required", "must be a FeatureCollection");
    return plan;
  }
  for (std::size_t i = 0; i < features->size() && i < 2000; ++i) {
    const std::string at = "/features/" + std::to_string(i);
    const Json *geometry = member((*features)[i], "geometry"),
               *properties = member((*features)[i], "properties");
    const Json* type = geometry ? member(*geometry, "type") : nullptr;
    const Json* coordinates = geometry ? member(*geometry, "coordinates") : nullptr;
    if (type == nullptr || coordinates == nullptr || !coordinates->is_array()) {
      fail(errors, at + "/geometry", "required", "must be a GeoJSON geometry");
      continue;
    }
    const Json none;
    const auto property = [&](const char* key) -> const Json& {
      const Json* found = properties ? member(*properties, key) : nullptr;
      return found ? *found : none;
    };
    const std::string kind = property("kind").is_string() ? property("kind").get<std::string>() : "";
    if (*type == "Point" && coordinates->size() >= 2) {
      const auto place = lat_lon((*coordinates)[1], (*coordinates)[0]);
      const Json& height = property("height_above_ground_m");
      if (!place || !height.is_number() || !(height.get<double>() >= 0 && height.get<double>() <= 500)) {
        fail(errors, at, "required", "a waypoint needs [lon, lat] and height_above_ground_m of 0 to 500 m");
        continue;
      }
      PlanWaypoint w;
      w.at = *place;
      w.height_m = height.get<double>();
      if (property("heading_deg").is_number())
        w.heading_deg = std::fmod(std::fmod(property("heading_deg").get<double>(), 360) + 360, 360);
      w.measure = kind != "transit";
      plan.waypoints.push_back(w);
    } else if (*type == "Polygon" && !coordinates->empty() && (*coordinates)[0].is_array()) {
      GeoPolygon area;
      for (const auto& corner : (*coordinates)[0]) {
        const auto p = corner.is_array() && corner.size() >= 2 ? lat_lon(corner[1], corner[0]) : std::nullopt;
        if (!p) {
          fail(errors, at + "/geometry/coordinates/0", "out_of_range", "must be [lon, lat] in degrees");
          break;
        }
        if (area.empty() || !(*p == area.back())) area.push_back(*p);
      }
      if (area.size() > 1 && area.front() == area.back()) area.pop_back();
      if (area.size() < 3) {
        fail(errors, at + "/geometry/coordinates/0", "out_of_range", "needs 3 different corners");
      } else if (kind == "no_fly") {
        plan.no_fly.push_back(std::move(area));
      } else if (kind == "fence") {
        plan.fence = std::move(area);
      } else if (plan.outline.empty()) {
        plan.outline = std::move(area);
        const Json& height = property("height_m");
        if (height.is_number() && height.get<double>() >= 1 && height.get<double>() <= 500)
          plan.building_height_m = height.get<double>();
      } else {
        fail(errors, at, "conflict", "a second building outline; mark other areas with kind no_fly or fence");
      }
    }
  }
  return plan;
}

}  // namespace anchord::api
