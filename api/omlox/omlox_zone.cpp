#include "api/omlox/omlox_zone.hpp"

#include <charconv>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "api/anchors/anchor_json.hpp"
#include "api/anchors/published_features.hpp"
#include "api/anchors/routes.hpp"
#include "api/omlox/omlox_uuid.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/place_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

/// Of the second spread over the first; below it the points are one line (as FrameFitOptions has it).
constexpr double k_line_ratio = 0.02;
constexpr std::size_t k_most_places = 1000;  ///< buildings of a site, floors of a building

double rounded(double value, double steps) { return std::round(value * steps) / steps; }
double degrees(double value) { return rounded(value, 1e9); }
double zone_metres(double value) { return rounded(value, 1e4); }

std::optional<double> level_of(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    return std::nullopt;
  return value;
}

/// What is said of the anchors' building and floor elsewhere: floors have names and levels.
class Places {
 public:
  explicit Places(PlaceStore& store) : store_(store) {}
  /// Of a floor that an anchor names by name or by level.
  std::optional<Floor> floor(const SiteId& site, const std::string& building, const std::string& floor) {
    const auto level = level_of(floor);
    for (const auto& one : floors(site, building)) {
      if (one.name == floor || (level && one.level == *level)) return one;
    }
    return std::nullopt;
  }

 private:
  const std::vector<Floor>& floors(const SiteId& site, const std::string& building) {
    auto [it, fresh] = known_.try_emplace({site, building});
    if (!fresh || building.empty()) return it->second;
    const auto all = store_.buildings(k_most_places, {}, site);
    if (!all) return it->second;
    for (const auto& one : all.value()) {
      if (one.name != building) continue;
      if (auto found = store_.floors(k_most_places, {}, one.id)) it->second = std::move(found).value();
      break;
    }
    return it->second;
  }
  PlaceStore& store_;
  std::map<std::pair<SiteId, std::string>, std::vector<Floor>> known_;
};

/// The first fitted frame of a site, as FeatureLookup takes it.
std::optional<std::pair<std::string, FrameDefinition>> fitted_frame(FrameStore& store, const SiteId& site) {
  const auto frames = store.frames_of(site);
  if (!frames) return std::nullopt;
  for (const auto& frame : frames.value()) {
    if (auto definition = frame_definition(frame)) return std::pair(frame.name, std::move(*definition));
  }
  return std::nullopt;
}

void name_zone(OmloxZone& zone, const Anchor& anchor, const std::optional<Site>& site, Places& places) {
  const std::string site_id = anchor.site ? to_string(*anchor.site) : "";
  zone.id = omlox_uuid("zone", site_id + '/' + anchor.building + '/' + anchor.floor);
  if (site) zone.site = site->name;
  zone.building = anchor.building;
  zone.floor = level_of(anchor.floor);
  std::string floor_name = anchor.floor;
  if (anchor.site) {
    if (const auto floor = places.floor(*anchor.site, anchor.building, anchor.floor)) {
      zone.floor = floor->level;
      floor_name = floor->name;
    }
  }
  zone.name = zone.site.empty() ? "anchors without a site" : zone.site;
  if (!zone.building.empty()) zone.name += ", " + zone.building;
  if (!floor_name.empty()) zone.name += ", floor " + floor_name;
  zone.foreign_id = "site-" + (site_id.empty() ? "none" : site_id);
}

/// Where local z is 0, in the middle of the anchors.
void place_frame(OmloxZone& zone, FrameStore& frames, const SiteId& site) {
  auto fitted = fitted_frame(frames, site);
  if (!fitted) return;
  zone.foreign_id = "frame-" + fitted->first;
  zone.frame = std::move(fitted->second);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double n = 0;
  for (const auto& anchor : zone.anchors) {
    if (!anchor.local_m) continue;
    sum += *anchor.local_m;
    n += 1;
  }
  if (n > 0) zone.height_m = zone.wgs84_from({sum.x() / n, sum.y() / n, 0}).height_m;
}

void add(OmloxZone& zone, const AnchorFeature& feature) {
  zone.revision = feature.revision.value_or(0);
  if (feature.calibrated && (!zone.measured || *zone.measured < *feature.calibrated))
    zone.measured = feature.calibrated;
  if (const auto accuracy = map_accuracy(feature); accuracy && std::isfinite(accuracy->h95_m))
    zone.h95_m = std::max(zone.h95_m.value_or(0), accuracy->h95_m);
  zone.anchors.push_back(
      {feature.anchor.network_id, feature.status, *feature.estimate->best->wgs84, feature.local_m});
}

Ordered control_points(const OmloxZone& zone, OmloxDialect dialect) {
  Ordered out = Ordered::array();
  for (const auto& anchor : zone.anchors) {
    if (!anchor.control_point()) continue;
    Ordered geographic = omlox_point(anchor.at, false), local = omlox_local_point(*anchor.local_m, false);
    if (dialect == OmloxDialect::objects) {
      Ordered pair = Ordered::object();
      pair["wgs84"] = std::move(geographic);
      pair["local"] = std::move(local);
      out.push_back(std::move(pair));
    } else {
      out.push_back(std::move(geographic["coordinates"]));
      out.push_back(std::move(local["coordinates"]));
    }
  }
  return out;
}

/// Under a name of our own: hubs keep properties as they are, of everybody.
Ordered properties(const OmloxZone& zone) {
  Ordered anchors = Ordered::array();
  for (const auto& anchor : zone.anchors) {
    Ordered one{{"network_id", to_string(anchor.network_id)},
                {"status", anchor.status},
                {"lon", degrees(anchor.at.lon_deg)},
                {"lat", degrees(anchor.at.lat_deg)},
                {"h_m", zone_metres(anchor.at.height_m)}};
    one["local_m"] = nullptr;
    if (anchor.local_m)
      one["local_m"] = {zone_metres(anchor.local_m->x()), zone_metres(anchor.local_m->y()),
                        zone_metres(anchor.local_m->z())};
    anchors.push_back(std::move(one));
  }
  Ordered ours{{"zone", to_string(zone.id)}, {"revision", zone.revision}};
  ours["h95_m"] = zone.h95_m ? Ordered(zone_metres(*zone.h95_m)) : Ordered(nullptr);
  ours["anchors"] = std::move(anchors);
  Ordered out = Ordered::object();
  out["anchord"] = std::move(ours);
  return out;
}

}  // namespace

bool OmloxZone::complete() const {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double n = 0;
  for (const auto& anchor : anchors) {
    if (!anchor.control_point()) continue;
    mean += anchor.local_m->head<2>();
    n += 1;
  }
  if (n < 3) return false;
  mean /= n;
  double xx = 0, xy = 0, yy = 0;
  for (const auto& anchor : anchors) {
    if (!anchor.control_point()) continue;
    const Eigen::Vector2d d = anchor.local_m->head<2>() - mean;
    xx += d.x() * d.x();
    xy += d.x() * d.y();
    yy += d.y() * d.y();
  }
  // Eigenvalues of the 2 x 2 scatter; their roots are the spreads along and across.
  const double half = (xx + yy) / 2, root = std::hypot((xx - yy) / 2, xy);
  const double first = half + root, second = std::max(0.0, half - root);
  return first > 0 && std::sqrt(second) >= k_line_ratio * std::sqrt(first);
}

Eigen::Vector3d OmloxZone::local_from(const Wgs84& at) const {
  return frame->fit.transform.local_from(EnuFrame(frame->origin).enu_from_wgs84(at).m);
}

Wgs84 OmloxZone::wgs84_from(const Eigen::Vector3d& local_m) const {
  return EnuFrame(frame->origin).wgs84_from_enu({frame->fit.transform.enu_from(local_m)});
}

std::vector<OmloxZone> omlox_zones(AnchorApi& s, PlaceStore& places) {
  std::uint64_t number = 0;
  std::map<std::tuple<std::optional<SiteId>, std::string, std::string>, OmloxZone> zones;
  Places of_places(places);
  for (const auto& feature : published_features(s, std::nullopt, number)) {
    if (feature.status == "retired") continue;
    if (!feature.estimate || !feature.estimate->best || !feature.estimate->best->wgs84) continue;
    const Anchor& anchor = feature.anchor;
    auto [it, fresh] = zones.try_emplace({anchor.site, anchor.building, anchor.floor});
    if (fresh) name_zone(it->second, anchor, feature.site, of_places);
    add(it->second, feature);
  }
  std::vector<OmloxZone> out;
  for (auto& [place, zone] : zones) {
    if (const auto& site = std::get<0>(place)) place_frame(zone, s.frames, *site);
    out.push_back(std::move(zone));
  }
  return out;
}

Ordered omlox_point(const Wgs84& at, bool with_height) {
  Ordered coordinates = Ordered::array({degrees(at.lon_deg), degrees(at.lat_deg)});
  if (with_height) coordinates.push_back(zone_metres(at.height_m));
  return {{"type", "Point"}, {"coordinates", std::move(coordinates)}};
}

Ordered omlox_local_point(const Eigen::Vector3d& local_m, bool with_height) {
  Ordered coordinates = Ordered::array({zone_metres(local_m.x()), zone_metres(local_m.y())});
  if (with_height) coordinates.push_back(zone_metres(local_m.z()));
  return {{"type", "Point"}, {"coordinates", std::move(coordinates)}};
}

std::string omlox_time(UtcTime time) {
  // "2026-05-04T10:11:12.345678Z" without its microseconds.
  std::string out = to_rfc3339(time);
  return out.size() == 27 ? out.substr(0, 23) + 'Z' : out;
}

Ordered omlox_zone_json(const OmloxZone& zone, OmloxDialect dialect) {
  Ordered out{
      {"id", to_string(zone.id)}, {"type", "uwb"}, {"foreign_id", zone.foreign_id}, {"name", zone.name}};
  if (!zone.site.empty()) out["site"] = zone.site;
  if (!zone.building.empty()) out["building"] = zone.building;
  if (zone.floor) out["floor"] = *zone.floor;
  if (zone.height_m) out["wgs84_height"] = zone_metres(*zone.height_m);
  if (zone.measured) out["measurement_timestamp"] = omlox_time(*zone.measured);
  out["incomplete_configuration"] = !zone.complete();
  out["ground_control_points"] = control_points(zone, dialect);
  out["properties"] = properties(zone);
  return out;
}

}  // namespace anchord::api
