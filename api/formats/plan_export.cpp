#include "api/formats/plan_export.hpp"

#include <nlohmann/json.hpp>

#include "api/formats/mission_item.hpp"
#include "core/base/to_wire.hpp"
#include "core/planning/local_plan.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

using namespace mission_item;

class Items {
 public:
  void put(int command, int frame, Ordered params, double altitude_m) {
    Ordered item;
    item["type"] = "SimpleItem";
    item["AMSLAltAboveTerrain"] = nullptr;
    item["Altitude"] = altitude_m;
    item["AltitudeMode"] = 1;  // relative to home
    item["autoContinue"] = true;
    item["command"] = command;
    item["doJumpId"] = items_.size() + 1;
    item["frame"] = frame;
    item["params"] = std::move(params);
    items_.push_back(std::move(item));
  }
  Ordered take() { return std::move(items_); }

 private:
  Ordered items_ = Ordered::array();
};

Ordered qgc_polygon(const GeoPolygon& polygon, bool inclusion) {
  Ordered corners = Ordered::array();
  for (const auto& p : polygon) corners.push_back({p.lat_deg, p.lon_deg});
  return {{"inclusion", inclusion}, {"polygon", corners}, {"version", 1}};
}

Ordered area_feature(const GeoPolygon& polygon, const char* kind) {
  Ordered ring = Ordered::array();
  for (const auto& p : polygon) ring.push_back({p.lon_deg, p.lat_deg});
  ring.push_back(ring.front());
  return {{"type", "Feature"},
          {"geometry", {{"type", "Polygon"}, {"coordinates", Ordered::array({ring})}}},
          {"properties", {{"kind", kind}}}};
}

void put_waypoint(Items& items, const PlanWaypoint& w, const PlanSettings& settings, Autopilot autopilot) {
  constexpr double k_turn_deg = 360, k_turn_deg_per_s = 30;
  const double hold_s = w.measure ? w.dwell_s.value_or(settings.dwell_s) : 0;
  const auto heading = w.heading_deg ? Ordered(*w.heading_deg) : Ordered(nullptr);
  items.put(k_waypoint, k_frame_relative, {hold_s, 0, 0, heading, w.at.lat_deg, w.at.lon_deg, w.height_m},
            w.height_m);
  // PX4 turns to the heading of the waypoint, and refuses a mission with the items that ArduPilot needs for
  // it.
  if (autopilot == Autopilot::px4) return;
  if (w.heading_deg) items.put(k_yaw, k_frame_mission, {*w.heading_deg, 0, 0, 0, 0, 0, 0}, 0);
  if (!w.turn) return;
  // ArduPilot begins to turn when it sets off to the item before: one that stays where it is.
  items.put(k_loiter_time, k_frame_relative,
            {k_turn_deg / k_turn_deg_per_s, 0, 0, nullptr, w.at.lat_deg, w.at.lon_deg, w.height_m},
            w.height_m);
  items.put(k_yaw, k_frame_mission, {k_turn_deg, k_turn_deg_per_s, 1, 1, 0, 0, 0}, 0);
}

}  // namespace

Result<std::string> plan_qgc(const Plan& plan, Autopilot autopilot) {
  BOOST_OUTCOME_TRY(const auto origin, planning::plan_origin(plan));
  LonLat home{origin.lon_deg, origin.lat_deg};
  Items items;
  if (!plan.waypoints.empty()) {
    const auto& first = plan.waypoints.front();
    home = first.at;
    items.put(k_takeoff, k_frame_relative, {0, 0, 0, nullptr, home.lat_deg, home.lon_deg, first.height_m},
              first.height_m);
  }
  // Ground speed; what is planned beside a building is not flown at the autopilot's own.
  items.put(k_speed, k_frame_mission, {1, plan.settings.speed_mps, -1, 0, 0, 0, 0}, 0);
  for (const auto& w : plan.waypoints) put_waypoint(items, w, plan.settings, autopilot);
  items.put(k_return, k_frame_mission, {0, 0, 0, 0, 0, 0, 0}, 0);

  Ordered polygons = Ordered::array();
  if (!plan.fence.empty()) polygons.push_back(qgc_polygon(plan.fence, true));
  if (!plan.outline.empty()) polygons.push_back(qgc_polygon(plan.outline, false));
  for (const auto& area : plan.no_fly) polygons.push_back(qgc_polygon(area, false));
  Ordered out;
  out["fileType"] = "Plan";
  out["groundStation"] = "QGroundControl";
  out["version"] = 1;
  out["geoFence"] = {{"circles", Ordered::array()}, {"polygons", std::move(polygons)}, {"version", 2}};
  out["rallyPoints"] = {{"points", Ordered::array()}, {"version", 2}};
  out["mission"] = {{"version", 2},
                    {"firmwareType",
                     autopilot == Autopilot::px4 ? 12 : 3},  // MAV_AUTOPILOT_PX4, MAV_AUTOPILOT_ARDUPILOTMEGA
                    {"vehicleType", 2},                      // MAV_TYPE_QUADROTOR
                    {"globalPlanAltitudeMode", 1},
                    {"cruiseSpeed", plan.settings.speed_mps},
                    {"hoverSpeed", plan.settings.speed_mps},
                    {"plannedHomePosition", {home.lat_deg, home.lon_deg, 0}},
                    {"items", items.take()}};
  return to_wire(out, 2) + "\n";
}

Result<std::string> plan_geojson(const Plan& plan) {
  Ordered features = Ordered::array(), line = Ordered::array();
  if (!plan.outline.empty()) {
    features.push_back(area_feature(plan.outline, "outline"));
    features.back()["properties"]["height_m"] = plan.building_height_m;
  }
  if (!plan.fence.empty()) features.push_back(area_feature(plan.fence, "fence"));
  for (const auto& area : plan.no_fly) features.push_back(area_feature(area, "no_fly"));
  for (std::size_t i = 0; i < plan.waypoints.size(); ++i) {
    const auto& w = plan.waypoints[i];
    line.push_back({w.at.lon_deg, w.at.lat_deg});
    features.push_back({{"type", "Feature"},
                        {"geometry", {{"type", "Point"}, {"coordinates", {w.at.lon_deg, w.at.lat_deg}}}},
                        {"properties",
                         {{"kind", w.measure ? "waypoint" : "transit"},
                          {"index", i},
                          {"height_above_ground_m", w.height_m},
                          {"heading_deg", w.heading_deg ? Ordered(*w.heading_deg) : Ordered(nullptr)}}}});
  }
  if (line.size() > 1) {
    features.push_back({{"type", "Feature"},
                        {"geometry", {{"type", "LineString"}, {"coordinates", line}}},
                        {"properties", {{"kind", "path"}}}});
  }
  Ordered out;
  out["type"] = "FeatureCollection";
  out["features"] = std::move(features);
  return to_wire(out, 2) + "\n";
}

}  // namespace anchord::api
