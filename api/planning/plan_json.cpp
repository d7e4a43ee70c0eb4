#include "api/planning/plan_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

constexpr double k_max_height_m = 500;
constexpr double k_min_target_m = 0.001, k_max_target_m = 10;
constexpr std::size_t k_max_waypoints = 1000, k_max_corners = 1000, k_max_areas = 100, k_max_anchors = 1000;

Ordered polygon_json(const GeoPolygon& polygon) {
  if (polygon.empty()) return nullptr;
  Ordered ring = Ordered::array();
  for (const auto& p : polygon) ring.push_back({p.lon_deg, p.lat_deg});
  ring.push_back(ring.front());  // GeoJSON closes its rings
  return {{"type", "Polygon"}, {"coordinates", Ordered::array({std::move(ring)})}};
}

void fail(std::vector<FieldError>& errors, std::string at, const char* code, const char* detail) {
  errors.push_back({std::move(at), code, detail});
}

GeoPolygon read_polygon(const Json& json, const std::string& at, std::vector<FieldError>& errors) {
  GeoPolygon out;
  if (!json.is_object() || json.value("type", Json()) != "Polygon" || !json.contains("coordinates") ||
      !json["coordinates"].is_array() || json["coordinates"].size() != 1 ||
      !json["coordinates"][0].is_array()) {
    fail(errors, at, "wrong_type", "must be a GeoJSON Polygon with one ring");
    return out;
  }
  const Json& ring = json["coordinates"][0];
  if (ring.size() < 3 || ring.size() > k_max_corners) {
    fail(errors, at + "/coordinates/0", "out_of_range", "needs 3 to 1000 corners");
    return out;
  }
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Json& p = ring[i];
    const bool pair = p.is_array() && p.size() >= 2 && p[0].is_number() && p[1].is_number();
    if (!pair || !(std::abs(p[0].get<double>()) <= 180) || !(std::abs(p[1].get<double>()) <= 90)) {
      fail(errors, at + "/coordinates/0/" + std::to_string(i), "out_of_range",
           "must be [lon, lat] in degrees");
      return {};
    }
    const LonLat corner{p[0].get<double>(), p[1].get<double>()};
    if (out.empty() || !(corner == out.back())) out.push_back(corner);
  }
  if (out.size() > 1 && out.front() == out.back()) out.pop_back();
  if (out.size() < 3) fail(errors, at + "/coordinates/0", "out_of_range", "needs 3 different corners");
  return out;
}

template <class T>
void take(const std::optional<T>& from, T& to) {
  if (from) to = *from;
}

void read_settings(const Json& json, PlanSettings& s, std::vector<FieldError>& errors) {
  Fields f(json, "/settings", errors);
  if (!f.is_object()) return;
  take(f.number("keep_out_m", 0.5, 100), s.keep_out_m);
  take(f.number("min_height_m", 0.5, k_max_height_m), s.min_height_m);
  take(f.number("max_height_m", 1, k_max_height_m), s.max_height_m);
  take(f.number("speed_mps", 0.1, 15), s.speed_mps);
  take(f.number("dwell_s", 0.5, 120), s.dwell_s);
  const auto whole = [&](const char* key, std::int64_t low, std::int64_t high, int& to) {
    if (const auto value = f.integer(key, low, high)) to = static_cast<int>(*value);
  };
  whole("samples", 1, 1000, s.samples);
  whole("k", 1, 20, s.k);
  take(f.boolean("turn"), s.turn);
  take(f.boolean("height_search"), s.height_search);
  take(f.number("grid_step_m", 0.1, 50), s.grid_step_m);
  take(f.number("grid_step_up_m", 0.1, 50), s.grid_step_up_m);
  whole("grid_reach", 1, 10, s.grid_reach);
  whole("grid_reach_up", 0, 10, s.grid_reach_up);
  if (const auto rule = f.word("rule", planning::k_rule_words)) s.rule = *rule;
  if (const auto combine = f.word("combine", planning::k_combine_words)) s.combine = *combine;
  whole("min_iterations", 1, 1000, s.min_iterations);
  whole("max_iterations", 1, 1000, s.max_iterations);
  take(f.number("target_sigma_m", k_min_target_m, k_max_target_m), s.target_sigma_m);
  if (const auto value = f.number("target_gdop", 0.1, 1000)) s.target_gdop = *value;
  if (const auto value = f.number("max_flight_s", 10, 14'400)) s.max_flight_s = *value;
  take(f.number("min_battery", 0.1, 0.95), s.min_battery);
  take(f.number("endurance_s", 60, 86'400), s.endurance_s);
  if (!(s.min_height_m < s.max_height_m)) {
    f.error("max_height_m", "out_of_range", "must be above min_height_m");
  }
  f.finish();
}

PlanWaypoint read_waypoint(const Json& json, const std::string& at, std::vector<FieldError>& errors) {
  PlanWaypoint w;
  Fields f(json, at, errors);
  if (!f.is_object()) return w;
  take(f.number("lon", -180, 180, true), w.at.lon_deg);
  take(f.number("lat", -90, 90, true), w.at.lat_deg);
  take(f.number("height_above_ground_m", 0, k_max_height_m, true), w.height_m);
  w.heading_deg = f.number("heading_deg", 0, 360);
  w.dwell_s = f.number("dwell_s", 0, 600);
  take(f.boolean("measure"), w.measure);
  take(f.boolean("turn"), w.turn);
  take(f.boolean("height_search"), w.height_search);
  f.finish();
  return w;
}

std::optional<NetworkId> read_anchor(const Json& id, const std::string& at, std::vector<FieldError>& errors) {
  const auto parsed = id.is_string()
                          ? parse_network_id(id.get<std::string>())
                          : Result<NetworkId>(make_error(Errc::invalid_argument, "must be a string"));
  if (parsed) return parsed.value();
  errors.push_back({at, "bad_id", parsed.error().message});
  return std::nullopt;
}

void read_target(const Json& json, const std::string& at, std::map<NetworkId, double>& targets,
                 std::vector<FieldError>& errors) {
  Fields f(json, at, errors);
  if (!f.is_object()) return;
  const Json* id = f.child("network_id");
  const auto anchor = read_anchor(id == nullptr ? Json() : *id, at + "/network_id", errors);
  const auto sigma_m = f.number("target_sigma_m", k_min_target_m, k_max_target_m, true);
  f.finish();
  if (anchor && sigma_m && !targets.emplace(*anchor, *sigma_m).second)
    errors.push_back({at + "/network_id", "duplicate", to_string(*anchor) + " has a target already"});
}

template <class F>
void each(Fields& fields, const char* key, std::size_t max, F read) {
  const Json* array = fields.child(key);
  if (array == nullptr) return;
  if (!array->is_array() || array->size() > max) {
    fields.error(key, "out_of_range", "must be an array of at most " + std::to_string(max));
    return;
  }
  for (std::size_t i = 0; i < array->size(); ++i)
    read((*array)[i], std::string("/") + key + '/' + std::to_string(i));
}

Ordered settings_json(const PlanSettings& s) {
  return {{"keep_out_m", s.keep_out_m},
          {"min_height_m", s.min_height_m},
          {"max_height_m", s.max_height_m},
          {"speed_mps", s.speed_mps},
          {"dwell_s", s.dwell_s},
          {"samples", s.samples},
          {"k", s.k},
          {"turn", s.turn},
          {"height_search", s.height_search},
          {"grid_step_m", s.grid_step_m},
          {"grid_step_up_m", s.grid_step_up_m},
          {"grid_reach", s.grid_reach},
          {"grid_reach_up", s.grid_reach_up},
          {"rule", to_string(s.rule)},
          {"combine", to_string(s.combine)},
          {"min_iterations", s.min_iterations},
          {"max_iterations", s.max_iterations},
          {"target_sigma_m", s.target_sigma_m},
          {"target_gdop", or_null(s.target_gdop)},
          {"max_flight_s", or_null(s.max_flight_s)},
          {"min_battery", s.min_battery},
          {"endurance_s", s.endurance_s}};
}

Ordered document_json(const Plan& plan) {
  Ordered out{{"name", plan.name}, {"site", plan.site ? Ordered(to_string(*plan.site)) : Ordered(nullptr)}};
  out["origin"] = plan.origin ? Ordered{{"lon", plan.origin->lon_deg},
                                        {"lat", plan.origin->lat_deg},
                                        {"h_m", plan.origin->height_m}}
                              : Ordered(nullptr);
  out["outline"] = polygon_json(plan.outline);
  out["building_height_m"] = plan.building_height_m;
  out["no_fly"] = Ordered::array();
  for (const auto& area : plan.no_fly) out["no_fly"].push_back(polygon_json(area));
  out["fence"] = polygon_json(plan.fence);
  out["settings"] = settings_json(plan.settings);
  out["expected_anchors"] = Ordered::array();
  for (const auto id : plan.expected_anchors) out["expected_anchors"].push_back(to_string(id));
  out["anchor_targets"] = Ordered::array();
  for (const auto& [id, sigma_m] : plan.anchor_target_sigma_m)
    out["anchor_targets"].push_back({{"network_id", to_string(id)}, {"target_sigma_m", sigma_m}});
  out["waypoints"] = Ordered::array();
  for (const auto& w : plan.waypoints) {
    out["waypoints"].push_back({{"lon", w.at.lon_deg},
                                {"lat", w.at.lat_deg},
                                {"height_above_ground_m", w.height_m},
                                {"heading_deg", or_null(w.heading_deg)},
                                {"dwell_s", or_null(w.dwell_s)},
                                {"measure", w.measure},
                                {"turn", w.turn},
                                {"height_search", w.height_search}});
  }
  return out;
}

}  // namespace

Ordered plan_json(const Plan& plan) {
  Ordered out{{"id", to_string(plan.id)}, {"revision", plan.version}};
  out.update(document_json(plan));
  out["created_at"] = to_rfc3339(plan.created);
  out["changed_at"] = to_rfc3339(plan.changed);
  return out;
}

Plan read_plan(const Json& body, std::vector<FieldError>& errors) {
  Plan plan;
  Fields f(body, "", errors);
  if (!f.is_object()) return plan;
  for (const char* given : {"id", "revision", "created_at", "changed_at", "links", "notes"})
    (void)f.child(given);
  take(f.text("name", record_limits::k_name, true), plan.name);
  if (const auto text = f.text("site", 36)) {
    if (const auto id = parse_uuid(*text))
      plan.site = SiteId{id.value()};
    else
      f.error("site", "bad_id", id.error().message);
  }
  if (const Json* origin = f.child("origin")) {
    Fields inner(*origin, "/origin", errors);
    const auto lon = inner.number("lon", -180, 180, true), lat = inner.number("lat", -90, 90, true),
               height = inner.number("h_m", -500, 9000, true);
    inner.finish();
    if (lon && lat && height) plan.origin = Wgs84{*lat, *lon, *height};
  }
  if (const Json* outline = f.child("outline")) plan.outline = read_polygon(*outline, "/outline", errors);
  take(f.number("building_height_m", 1, k_max_height_m), plan.building_height_m);
  each(f, "no_fly", k_max_areas, [&](const Json& area, const std::string& at) {
    plan.no_fly.push_back(read_polygon(area, at, errors));
  });
  if (const Json* fence = f.child("fence")) plan.fence = read_polygon(*fence, "/fence", errors);
  if (const Json* settings = f.child("settings")) read_settings(*settings, plan.settings, errors);
  each(f, "expected_anchors", k_max_anchors, [&](const Json& id, const std::string& at) {
    if (const auto anchor = read_anchor(id, at, errors)) plan.expected_anchors.push_back(*anchor);
  });
  each(f, "anchor_targets", k_max_anchors, [&](const Json& target, const std::string& at) {
    read_target(target, at, plan.anchor_target_sigma_m, errors);
  });
  each(f, "waypoints", k_max_waypoints, [&](const Json& waypoint, const std::string& at) {
    plan.waypoints.push_back(read_waypoint(waypoint, at, errors));
  });
  f.finish();
  return plan;
}

StoredPlan stored(const Plan& plan) {
  return {plan.id,      plan.name,    plan.site,   {to_wire(document_json(plan))},
          plan.created, plan.changed, plan.version};
}

Plan plan_of(const StoredPlan& row) {
  std::vector<FieldError> errors;
  Json document;
  Plan plan;
  const bool is_json = !parse_json(row.document.text, document);
  if (is_json) plan = read_plan(document, errors);
  if (!is_json || !errors.empty()) {
    plan = Plan{};
    plan.name = row.name + " (its document cannot be read)";
    plan.site = row.site;
  }
  plan.id = row.id;
  plan.created = row.created;
  plan.changed = row.changed;
  plan.version = row.version;
  return plan;
}

Ordered plan_check_json(const planning::PlanCheck& check) {
  Ordered issues = Ordered::array();
  for (const auto& i : check.issues) {
    issues.push_back({{"severity", planning::k_severity_words.word(i.severity)},
                      {"code", i.code},
                      {"pointer", i.pointer},
                      {"text", i.text}});
  }
  Ordered predicted(nullptr);
  if (!check.predicted_sigma_m.empty()) {
    Ordered anchors = Ordered::array();
    for (std::size_t i = 0; i < check.assumed_anchors_m.size(); ++i) {
      const auto& at = check.assumed_anchors_m[i];
      const auto& gdop = check.predicted_gdop[i];
      anchors.push_back({{"enu_m", {at.x(), at.y(), at.z()}},
                         {"sigma_m", check.predicted_sigma_m[i]},
                         {"gdop", gdop ? Ordered(*gdop) : Ordered(nullptr)}});
    }
    predicted = {{"rms_m", check.rms_m},
                 {"worst_m", check.worst_m},
                 {"n_out_of_range", check.n_out_of_range},
                 {"anchors", std::move(anchors)}};
  }
  return {{"flyable", check.flyable()},         {"issues", std::move(issues)},
          {"length_m", check.length_m},         {"duration_s", check.time.expected_s},
          {"duration_low_s", check.time.low_s}, {"duration_high_s", check.time.high_s},
          {"n_measure", check.n_measure},       {"predicted", std::move(predicted)}};
}

}  // namespace anchord::api
