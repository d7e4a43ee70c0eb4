#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "api/anchors/frame_json.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/omlox_dialect.hpp"
#include "core/types/position.hpp"

namespace anchord {
class PlaceStore;
}

namespace anchord::api {

struct AnchorApi;

/// A published anchor of a zone; with local metres, and accepted, it is a ground control point.
struct OmloxAnchor {
  NetworkId network_id{};
  std::string status;  ///< of the published feature
  Wgs84 at{};
  std::optional<Eigen::Vector3d> local_m{};
  bool control_point() const { return local_m && status == "accepted"; }
};

/// A calibrated floor: what omlox calls a zone, the area of one positioning system.
struct OmloxZone {
  Uuid id{};
  std::string foreign_id, name, site, building;  ///< empty: not known
  std::optional<double> floor{};                 ///< 0: ground; halves for mezzanines
  std::uint64_t revision{};                      ///< that was read
  std::optional<UtcTime> measured{};             ///< of the newest anchor
  std::optional<double> height_m{};              ///< ellipsoidal, where local z is 0
  std::optional<double> h95_m{};                 ///< of the worst anchor
  std::optional<FrameDefinition> frame{};
  std::vector<OmloxAnchor> anchors;  ///< in order of network id
  /// Three control points that are not on one line: a hub can turn local into geographic numbers.
  bool complete() const;

  /// With a fitted frame: local metres from a place on the globe, and back.
  Eigen::Vector3d local_from(const Wgs84& at) const;
  Wgs84 wgs84_from(const Eigen::Vector3d& local_m) const;
};

/// One for each site, building and floor that has published anchors, in order of these.
std::vector<OmloxZone> omlox_zones(AnchorApi& anchors, PlaceStore& places);

nlohmann::ordered_json omlox_zone_json(const OmloxZone& zone, OmloxDialect dialect);
/// GeoJSON: degrees to a tenth of a millimetre, metres likewise.
nlohmann::ordered_json omlox_point(const Wgs84& at, bool with_height = true);
nlohmann::ordered_json omlox_local_point(const Eigen::Vector3d& local_m, bool with_height = true);
/// ISO 8601 with milliseconds, as omlox has it.
std::string omlox_time(UtcTime time);

}  // namespace anchord::api
