#include "api/formats/qgc_plan.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <utility>

#include "api/formats/mission_item.hpp"
#include "core/geo/enu.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

using namespace mission_item;

constexpr std::size_t k_max_items = 1000, k_max_areas = 100;

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

/// The shapes of a fence under `key`; nothing: there are none, or they are wrong (reported).
const Json* fence_shapes(const Json& fence, const char* key, std::vector<FieldError>& errors) {
  const Json* shapes = member(fence, key);
  if (shapes == nullptr || (shapes->is_array() && shapes->size() <= k_max_areas)) return shapes;
  fail(errors, std::string("/geoFence/") + key, "wrong_type", "must be an array of at most 100");
  return nullptr;
}

/// A second fence would leave the aircraft without the first.
void take_area(const Json& shape, GeoPolygon area, const std::string& at, Plan& plan,
               std::vector<FieldError>& errors) {
  const Json* inclusion = member(shape, "inclusion");
  if (inclusion != nullptr && !inclusion->is_boolean())
    return fail(errors, at + "/inclusion", "wrong_type", "must be true (a fence) or false (a no-fly area)");
  if (inclusion == nullptr || *inclusion == false) {
    plan.no_fly.push_back(std::move(area));
  } else if (plan.fence.empty()) {
    plan.fence = std::move(area);
  } else {
    fail(errors, at, "conflict", "a second inclusion: a plan has one fence, so draw one polygon round both");
  }
}

void read_polygons(const Json& fence, Plan& plan, std::vector<FieldError>& errors) {
  const Json* polygons = fence_shapes(fence, "polygons", errors);
  for (std::size_t i = 0; polygons != nullptr && i < polygons->size(); ++i) {
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
    take_area((*polygons)[i], std::move(area), at, plan, errors);
  }
}

void read_circles(const Json& fence, Plan& plan, std::vector<FieldError>& errors) {
  const Json* circles = fence_shapes(fence, "circles", errors);
  for (std::size_t i = 0; circles != nullptr && i < circles->size(); ++i) {
    const std::string here = "/geoFence/circles/" + std::to_string(i);
    const Json* circle = member((*circles)[i], "circle");
    const Json* centre = circle ? member(*circle, "center") : nullptr;
    const Json* radius = circle ? member(*circle, "radius") : nullptr;
    const auto middle = centre != nullptr && centre->is_array() && centre->size() >= 2
                            ? lat_lon((*centre)[0], (*centre)[1])
                            : std::nullopt;
    if (!middle || radius == nullptr || !radius->is_number() || !(radius->get<double>() > 0)) {
      fail(errors, here, "wrong_type", "needs circle.center and circle.radius");
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
    take_area((*circles)[i], std::move(area), here, plan, errors);
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

constexpr double k_same_place_m = 0.1, k_most_dwell_s = 600;

bool same_place(const PlanWaypoint& a, const PlanWaypoint& b) {
  const EnuFrame frame({a.at.lat_deg, a.at.lon_deg, 0});
  return frame.enu_from_wgs84({b.at.lat_deg, b.at.lon_deg, 0}).m.head<2>().norm() < k_same_place_m &&
         std::abs(a.height_m - b.height_m) < k_same_place_m;
}

/// Time that is spent at the last waypoint; none is measured in less.
void add_dwell(Plan& plan, double seconds) {
  if (plan.waypoints.empty()) return;
  auto& w = plan.waypoints.back();
  const double dwell_s = std::min(w.dwell_s.value_or(0) + seconds, k_most_dwell_s);
  w.measure = dwell_s > 0;
  w.dwell_s = w.measure ? std::optional(dwell_s) : std::nullopt;
}

/// A change of yaw: a whole turn, or the heading of the waypoint before it. `loitered_s`: of an item that
/// only stays where the waypoint before it is, for the time of the turn.
void read_yaw(const Item& item, const std::string& at, double loitered_s, Plan& plan,
              std::vector<std::string>& notes) {
  const Json& p = *item.params;
  if (plan.waypoints.empty() || !p[0].is_number()) return;
  auto& w = plan.waypoints.back();
  const double angle_deg = p[0].get<double>();
  const bool relative = p[3].is_number() && p[3].get<double>() > 0;
  if (!relative) {
    w.heading_deg = std::fmod(std::fmod(angle_deg, 360) + 360, 360);
  } else if (std::abs(angle_deg) >= 360) {
    w.turn = true;
    add_dwell(plan, -loitered_s);
  } else {
    notes.push_back(
        at + " turns by part of a circle from where the nose is: left out, headings are those of waypoints");
  }
}

void read_speed(const Item& item, const std::string& at, Plan& plan, bool& known,
                std::vector<std::string>& notes) {
  const Json& speed = (*item.params)[1];
  if (!speed.is_number() || !(speed.get<double>() >= 0.1 && speed.get<double>() <= 15)) return;
  if (known && speed.get<double>() != plan.settings.speed_mps) {
    notes.push_back(at + " changes the speed on the way: left out, a plan is flown at one speed");
    return;
  }
  plan.settings.speed_mps = speed.get<double>();
  known = true;
}

/// A command that the procedure has no use for, in words that say what of the flight is missing.
std::string left_out(const std::string& at, const Item& item) {
  const auto place = lat_lon((*item.params)[4], (*item.params)[5]);
  const bool somewhere =
      item.command <= k_last_flown && place && (place->lat_deg != 0 || place->lon_deg != 0);
  return at + " has command " + std::to_string(item.command) +
         " of MAVLink, which a calibration flight does not use: left out" +
         (somewhere ? ", and its place is not flown to: make it a waypoint where it is to be" : "");
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
  if (p[0].is_number() && p[0].get<double>() >= 0 && p[0].get<double>() <= k_most_dwell_s) {
    w.measure = p[0].get<double>() > 0;
    if (w.measure) w.dwell_s = p[0].get<double>();
  }
  if (p[3].is_number()) w.heading_deg = std::fmod(std::fmod(p[3].get<double>(), 360) + 360, 360);
  plan.waypoints.push_back(w);
}

/// A place to stay at: a waypoint, or where it is that of the one before it, time there. Returns the seconds
/// of the latter.
double read_loiter(const Item& item, const std::string& at, double home_m, Plan& plan,
                   std::vector<FieldError>& errors) {
  const std::size_t before = plan.waypoints.size();
  read_waypoint(item, at, home_m, plan, errors);
  if (plan.waypoints.size() < 2 || plan.waypoints.size() == before) return 0;
  const PlanWaypoint loiter = plan.waypoints.back();
  if (!same_place(plan.waypoints[before - 1], loiter)) {
    plan.waypoints.back().heading_deg.reset();  // its fourth parameter is not a heading
    return 0;
  }
  plan.waypoints.pop_back();
  add_dwell(plan, loiter.dwell_s.value_or(0));
  return loiter.dwell_s.value_or(0);
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
  bool speed_known = false;
  double loitered_s = 0;
  for (std::size_t i = 0; i < items->size(); ++i) {
    const std::string at = "/mission/items/" + std::to_string(i);
    const auto item = read_item((*items)[i], at, notes, errors);
    if (!item) continue;
    const double stayed_s = std::exchange(loitered_s, 0);
    if (item->command == k_waypoint || item->command == k_spline) {
      read_waypoint(*item, at, home_m, plan, errors);
      if (item->command == k_spline)
        notes.push_back(at + " is a spline waypoint: it is flown to in a straight line");
    } else if (item->command == k_loiter_time) {
      loitered_s = read_loiter(*item, at, home_m, plan, errors);
    } else if (item->command == k_delay) {
      if (const Json& s = (*item->params)[0]; s.is_number() && s.get<double>() > 0)
        add_dwell(plan, s.get<double>());
    } else if (item->command == k_speed) {
      read_speed(*item, at, plan, speed_known, notes);
    } else if (item->command == k_yaw) {
      read_yaw(*item, at, stayed_s, plan, notes);
    } else if (item->command >= k_fence_first && item->command <= k_fence_last) {
      fail(errors, at + "/command", "unknown_value",
           "is a fence among the mission items: draw it in geoFence (version 2)");
    } else if (item->command != k_takeoff && item->command != k_return && item->command != k_land) {
      notes.push_back(left_out(at, *item));
    }
  }
  if (const Json* fence = member(file, "geoFence")) {
    for (const char* old : {"polygon", "circle"}) {
      const Json* shape = member(*fence, old);
      if (shape != nullptr && !shape->empty())
        fail(errors, std::string("/geoFence/") + old, "unknown_field",
             "is a fence of version 1: open the plan in a newer QGroundControl and save it again");
    }
    read_polygons(*fence, plan, errors);
    read_circles(*fence, plan, errors);
  }
  return plan;
}

}  // namespace anchord::api
