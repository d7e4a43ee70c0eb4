#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/time.hpp"
#include "core/types/mission.hpp"
#include "core/types/position.hpp"

namespace anchord {
class MissionStore;
}

namespace anchord::api {

class Hub;
struct OmloxZone;

/// What carries a position: the first tag of a flight, whose place is known; of a flight without tags the
/// receiver of the aircraft. With the aircraft (a trackable) that it belongs to.
struct OmloxProvider {
  std::string id, type, name;  ///< id: of a tag its network id
  Uuid trackable{};
  std::string aircraft;
};
OmloxProvider omlox_provider(const Mission& mission);

/// Where a provider was at its newest.
struct OmloxLocation {
  OmloxProvider provider;
  MissionId mission{};
  UtcTime time{};  ///< measured
  Wgs84 at{};
  std::optional<double> accuracy_m{};  ///< horizontal, one sigma of both axes together
  std::optional<double> heading_deg{}, speed_mps{};
  std::string fix;  ///< fixed, float, ...
};

/// Positions of flights as omlox has them, from topic `drone.pose`. Thread-safe.
/// missions: as who asks may see them, so that lists have their flights alone
class OmloxLocations {
 public:
  OmloxLocations(const Hub& hub, MissionStore& missions) : hub_(hub), missions_(missions) {}

  /// Providers of the newest flights, each once, newest flight first. Reads the store.
  std::vector<OmloxProvider> providers();
  /// The newest of each provider. Reads the store where a flight is not known yet.
  std::vector<OmloxLocation> newest();
  /// Looks up flights that were not known; about once a second, by who may wait for the disk.
  void refresh();
  /// Whether the flight with this key (its id) of drone.pose is known. Waits for nothing.
  bool known(const std::string& key) const;
  /// Of one message of drone.pose; nothing where it is not on the globe, or its flight is not known yet.
  /// Waits for nothing.
  std::optional<OmloxLocation> location(std::string_view pose_json) const;

 private:
  /// Whether who asks may see it; reads the store for who is bound to sites.
  bool sees(const MissionId& mission);
  const Hub& hub_;
  MissionStore& missions_;
  Locked<std::map<MissionId, OmloxProvider>> known_;
};

/// A Location of omlox; `local`: in the metres of this zone, which has a frame. `sent`: when it goes out.
nlohmann::ordered_json omlox_location_json(const OmloxLocation& location, UtcTime sent,
                                           const OmloxZone* local = nullptr);
/// The same as a GeoJSON feature: all but the position are its properties.
nlohmann::ordered_json omlox_feature(nlohmann::ordered_json object);
nlohmann::ordered_json omlox_provider_json(const OmloxProvider& provider);
/// The aircraft of these providers, each once with all of them.
nlohmann::ordered_json omlox_trackables(const std::vector<OmloxProvider>& providers);

}  // namespace anchord::api
