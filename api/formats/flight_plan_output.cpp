#include "api/formats/flight_plan_output.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/planning/local_plan.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

/// 1e-9 deg is 0.1 mm; more digits only make files unreadable.
double rounded(double value, double per_unit) { return std::round(value * per_unit) / per_unit; }
double heading_deg(const planning::Waypoint& w) {
  const double deg = w.heading_rad * 180 / std::numbers::pi;
  return rounded(deg < 0 ? deg + 360 : deg, 10);
}

struct Place {
  double lon_deg, lat_deg;
};
/// The ground is taken flat at the origin's height: over a building's size the tangent plane is off by
/// micrometres.
Place place_of(const EnuFrame& frame, const Eigen::Vector2d& p) {
  const auto at = frame.wgs84_from_enu(Enu{{p.x(), p.y(), 0}});
  return {rounded(at.lon_deg, 1e9), rounded(at.lat_deg, 1e9)};
}

Ordered predicted_json(const planning::FlightPlan& plan) {
  return {{"n_anchors_assumed", plan.assumed_anchors_m.size()},
          {"n_out_of_range", plan.n_out_of_range},
          {"rms_m", plan.rms_m},
          {"worst_m", plan.worst_m}};
}

}  // namespace

std::string flight_plan_json(const planning::FlightPlan& plan, const Wgs84& origin) {
  const EnuFrame frame(origin);
  Ordered out;
  out["origin"] = {{"lon", origin.lon_deg}, {"lat", origin.lat_deg}};
  out["n_measure"] = plan.n_measure;
  out["length_m"] = plan.length_m;
  out["duration_s"] = plan.duration_s;
  out["predicted"] = predicted_json(plan);
  out["reason"] = plan.reason;
  out["waypoints"] = Ordered::array();
  for (const auto& w : plan.waypoints) {
    const auto at = place_of(frame, w.point_m.head<2>());
    out["waypoints"].push_back({{"lon", at.lon_deg},
                                {"lat", at.lat_deg},
                                {"height_above_ground_m", w.point_m.z()},
                                {"enu_m", {w.point_m.x(), w.point_m.y(), w.point_m.z()}},
                                {"heading_deg", heading_deg(w)},
                                {"measure", w.measure}});
  }
  return to_wire(out, 2) + "\n";
}

std::string flight_plan_geojson(const planning::FlightPlan& plan, const Wgs84& origin) {
  const EnuFrame frame(origin);
  Ordered features = Ordered::array(), line = Ordered::array();
  for (std::size_t i = 0; i < plan.waypoints.size(); ++i) {
    const auto& w = plan.waypoints[i];
    const auto at = place_of(frame, w.point_m.head<2>());
    line.push_back({at.lon_deg, at.lat_deg});
    features.push_back({{"type", "Feature"},
                        {"geometry", {{"type", "Point"}, {"coordinates", {at.lon_deg, at.lat_deg}}}},
                        {"properties",
                         {{"kind", w.measure ? "waypoint" : "transit"},
                          {"index", i},
                          {"height_above_ground_m", w.point_m.z()},
                          {"heading_deg", heading_deg(w)}}}});
  }
  if (!line.empty()) line.push_back(line.front());
  features.push_back({{"type", "Feature"},
                      {"geometry", {{"type", "LineString"}, {"coordinates", line}}},
                      {"properties",
                       {{"kind", "path"},
                        {"length_m", plan.length_m},
                        {"duration_s", plan.duration_s},
                        {"predicted", predicted_json(plan)},
                        {"reason", plan.reason}}}});
  Ordered out;
  out["type"] = "FeatureCollection";
  out["features"] = features;
  return to_wire(out, 2) + "\n";
}

Plan flight_as_plan(const planning::FlightPlan& flight, const planning::FlightPlanInput& input,
                    const Wgs84& origin, const planning::FlightPlanOptions& options) {
  const EnuFrame frame(origin);
  const auto area = [&](const planning::Polygon& polygon) {
    GeoPolygon out;
    for (const auto& corner : polygon) {
      const auto at = place_of(frame, corner);
      out.push_back({at.lon_deg, at.lat_deg});
    }
    return out;
  };
  Plan plan;
  plan.origin = origin;
  plan.outline = area(input.outline);
  plan.fence = area(input.fence);
  for (const auto& polygon : input.no_fly) plan.no_fly.push_back(area(polygon));
  plan.building_height_m = input.building_height_m;
  plan.settings.keep_out_m = options.keep_out_m;
  plan.settings.speed_mps = options.speed_mps;
  plan.settings.dwell_s = options.dwell_s;
  plan.settings.turn = plan.settings.height_search = false;
  return planning::with_waypoints(std::move(plan), flight, origin);
}

}  // namespace anchord::api
