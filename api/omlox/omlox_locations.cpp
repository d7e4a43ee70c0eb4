#include "api/omlox/omlox_locations.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/current_sites.hpp"
#include "api/omlox/omlox_uuid.hpp"
#include "api/omlox/omlox_zone.hpp"
#include "api/stream/hub.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::size_t k_most_missions = 1000;  ///< of which providers are listed
constexpr std::size_t k_most_known = 10'000;

double metres(double value) { return std::round(value * 1e4) / 1e4; }

std::optional<double> number(const Json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || !at->is_number()) return std::nullopt;
  return at->get<double>();
}

std::optional<Eigen::Vector3d> vector(const Json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || !at->is_array() || at->size() != 3) return std::nullopt;
  if (!std::ranges::all_of(*at, [](const Json& one) { return one.is_number(); })) return std::nullopt;
  return Eigen::Vector3d{(*at)[0].get<double>(), (*at)[1].get<double>(), (*at)[2].get<double>()};
}

std::optional<MissionId> mission_of(const Json& pose) {
  const auto at = pose.find("mission");
  if (at == pose.end() || !at->is_string()) return std::nullopt;
  const auto id = parse_uuid(at->get_ref<const std::string&>());
  return id ? std::optional(MissionId{id.value()}) : std::nullopt;
}

}  // namespace

OmloxProvider omlox_provider(const Mission& mission) {
  OmloxProvider out;
  const std::string aircraft = mission.kit.empty() ? to_string(mission.id) : mission.kit;
  out.trackable = omlox_uuid("aircraft", aircraft);
  out.aircraft = mission.kit.empty() ? mission.name : mission.kit;
  if (mission.tags.empty()) {
    out.id = "gnss-" + to_string(out.trackable);
    out.type = "gps";
    out.name = "receiver of " + out.aircraft;
  } else {
    out.id = to_string(mission.tags.front().tag);
    out.type = "uwb";
    out.name = "tag " + out.id + " of " + out.aircraft;
  }
  return out;
}

std::vector<OmloxProvider> OmloxLocations::providers() {
  std::vector<OmloxProvider> out;
  const auto missions = missions_.missions(k_most_missions, {});
  if (!missions) return out;
  for (const auto& mission : missions.value()) {
    auto one = omlox_provider(mission);
    // A tag belongs to the aircraft that flew it last: a hub allows one.
    if (std::ranges::find(out, one.id, &OmloxProvider::id) == out.end()) out.push_back(std::move(one));
  }
  return out;
}

void OmloxLocations::refresh() {
  const auto newest = hub_.newest(Topic::drone_pose, 0);
  if (!newest) return;
  for (const auto& element : newest->elements) {
    const auto id = parse_uuid(element.key);
    if (!id) continue;
    const MissionId mission{id.value()};
    {
      const auto known = known_.lock();
      if (known->contains(mission)) continue;
    }
    const auto stored = missions_.mission(mission);
    if (!stored) continue;  // its row follows the flight, or it was deleted
    auto provider = omlox_provider(stored.value());
    auto known = known_.lock();
    if (known->size() >= k_most_known) known->clear();
    known->insert_or_assign(mission, std::move(provider));
  }
}

std::vector<OmloxLocation> OmloxLocations::newest() {
  refresh();
  std::vector<OmloxLocation> out;
  const auto newest = hub_.newest(Topic::drone_pose, 0);
  if (!newest) return out;
  for (const auto& element : newest->elements) {
    auto one = location(*element.json);
    if (!one || !sees(one->mission)) continue;
    const auto same = std::ranges::find_if(
        out, [&](const OmloxLocation& other) { return other.provider.id == one->provider.id; });
    if (same == out.end())
      out.push_back(std::move(*one));
    else if (same->time < one->time)
      *same = std::move(*one);
  }
  return out;
}

bool OmloxLocations::sees(const MissionId& mission) {
  return current_sites().all() || missions_.mission(mission).has_value();
}

bool OmloxLocations::known(const std::string& key) const {
  const auto id = parse_uuid(key);
  const auto known = known_.lock();
  return !id || known->contains(MissionId{id.value()});
}

std::optional<OmloxLocation> OmloxLocations::location(std::string_view pose_json) const {
  const Json pose = Json::parse(pose_json, nullptr, false);
  if (!pose.is_object()) return std::nullopt;
  const auto mission = mission_of(pose);
  const auto lon = number(pose, "lon"), lat = number(pose, "lat"), h_m = number(pose, "h_m");
  if (!mission || !lon || !lat || !h_m) return std::nullopt;
  OmloxLocation out;
  {
    const auto known = known_.lock();
    const auto at = known->find(*mission);
    if (at == known->end()) return std::nullopt;
    out.provider = at->second;
  }
  out.mission = *mission;
  out.time = UtcTime::from_us(pose.value("t_us", std::int64_t{0}));
  out.at = {*lat, *lon, *h_m};
  const auto point = vector(pose, "enu_m"), tag = vector(pose, "tag_enu_m");
  // Axes of the site's origin are those of here for the length of an aircraft.
  if (point && tag) out.at = EnuFrame(out.at).wgs84_from_enu({*tag - *point});
  if (const auto sigma = vector(pose, "sigma_m")) out.accuracy_m = std::hypot(sigma->x(), sigma->y());
  out.heading_deg = number(pose, "heading_deg");
  out.speed_mps = number(pose, "speed_mps");
  out.fix = pose.value("fix", std::string());
  return out;
}

Ordered omlox_location_json(const OmloxLocation& location, UtcTime sent, const OmloxZone* local) {
  const auto& provider = location.provider;
  Ordered out = Ordered::object();
  out["position"] =
      local == nullptr ? omlox_point(location.at) : omlox_local_point(local->local_from(location.at));
  // The id of the zone whose metres these are; of what locates itself its own id.
  out["source"] = local == nullptr ? provider.id : to_string(local->id);
  out["provider_type"] = provider.type;
  out["provider_id"] = provider.id;
  out["timestamp_generated"] = omlox_time(location.time);
  out["timestamp_sent"] = omlox_time(sent);
  out["crs"] = local == nullptr ? "EPSG:4326" : "local";
  if (local == nullptr) out["elevation_ref"] = "wgs84";
  if (location.accuracy_m) out["accuracy"] = metres(*location.accuracy_m);
  if (location.heading_deg) out["true_heading"] = *location.heading_deg;
  if (location.speed_mps) out["speed"] = *location.speed_mps;
  out["trackables"] = Ordered::array({to_string(provider.trackable)});
  Ordered ours{{"mission", to_string(location.mission)}, {"fix", location.fix}};
  out["properties"] = Ordered::object();
  out["properties"]["anchord"] = std::move(ours);
  return out;
}

Ordered omlox_feature(Ordered object) {
  Ordered out{{"type", "Feature"}};
  out["geometry"] = std::move(object["position"]);
  object.erase("position");
  out["properties"] = std::move(object);
  return out;
}

Ordered omlox_provider_json(const OmloxProvider& provider) {
  Ordered out{{"id", provider.id}, {"type", provider.type}, {"name", provider.name}};
  out["properties"] = Ordered::object();
  out["properties"]["anchord"] = Ordered{{"aircraft", provider.aircraft}};
  return out;
}

Ordered omlox_trackables(const std::vector<OmloxProvider>& providers) {
  Ordered out = Ordered::array();
  for (const auto& provider : providers) {
    const std::string id = to_string(provider.trackable);
    auto at = std::ranges::find_if(out, [&](const Ordered& one) { return one["id"] == id; });
    if (at == out.end()) {
      Ordered one{{"id", id}, {"type", "virtual"}, {"name", provider.aircraft}};
      one["location_providers"] = Ordered::array();
      out.push_back(std::move(one));
      at = out.end() - 1;
    }
    (*at)["location_providers"].push_back(provider.id);
  }
  return out;
}

}  // namespace anchord::api
