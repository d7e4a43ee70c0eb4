#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/types/plan.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// What became of a command to the aircraft.
enum class CommandState : std::uint8_t {
  sent,
  accepted,     ///< acknowledged, or seen to be done
  refused,      ///< by the autopilot, with its reason
  unconfirmed,  ///< neither within 2 s: an alarm; never repeated by itself after that
};

struct CommandReport {
  std::uint64_t number{};
  std::string what;  ///< take_off, go_to, hold, return_home, land, upload
  CommandState state{};
  std::string text;
};

/// Somebody else on the aircraft's link: another vehicle, a ground station, a datagram of a stranger. Counted
/// and shown, never obeyed.
struct OtherOnLink {
  std::string sender;  ///< address and port; empty: the aircraft's own end of the link
  int system{}, component{};
  std::string kind;  ///< autopilot, ground station, other, unsigned, no MAVLink
  std::uint64_t frames{};
  double silent_s{};
};

/// How the aircraft is, as its autopilot tells. Ages in seconds.
struct DroneStatus {
  bool connected{false};  ///< heard within the last 3 s
  double silent_s{};
  std::string autopilot;  ///< "ArduPilot", "PX4" or empty
  std::string mode;       ///< word of the autopilot's mode
  bool armed{false}, in_air{false}, failsafe{false};
  bool taken_over{
      false};  ///< somebody else changed the mode: no target is sent until the operator starts anew
  std::optional<Wgs84> position{};     ///< height_m above the ellipsoid where known, else above sea level
  std::optional<double> relative_m{};  ///< above home
  std::optional<double> heading_deg{}, speed_mps{}, battery{};
  std::optional<Wgs84> home{};
  int gps_fix{};     ///< MAVLink's number: 5 RTK float, 6 RTK fixed
  std::string text;  ///< newest warning of the autopilot
  std::string peer;  ///< address and port of the aircraft where the link has senders (UDP)
  bool link_signed{false};              ///< frames without our key's signature are refused
  std::uint64_t frames_refused{};       ///< unsigned, badly signed, or signed a second time
  std::vector<OtherOnLink> others;
};

/// A place of the route that the autopilot keeps beside its commands, for the pilot's own screen and for a
/// flight without us.
struct RoutePoint {
  LonLat at{};
  double height_m{};  ///< above home
  std::optional<double> heading_deg{};
  double dwell_s{};
};

/// Areas that the autopilot keeps to by itself, whoever flies.
struct DroneFence {
  GeoPolygon inside;                ///< empty: none
  std::vector<GeoPolygon> outside;  ///< not to be flown into
};

/// What the procedure may ask of an aircraft. Calls return at once with the number of the command; its fate
/// comes through take_reports(). Heights above home. Before the aircraft was heard every command is refused.
class Drone {
 public:
  virtual ~Drone() = default;
  virtual std::uint64_t take_off(double height_m) = 0;
  virtual std::uint64_t go_to(double lat_deg, double lon_deg, double height_m,
                              std::optional<double> heading_deg) = 0;
  virtual std::uint64_t hold() = 0;
  virtual std::uint64_t return_home() = 0;
  virtual std::uint64_t land() = 0;
  /// Both replace what the autopilot kept, are read back and compared: accepted means that it keeps them.
  /// They take seconds; unconfirmed after five questions without an answer.
  virtual std::uint64_t upload_route(const std::vector<RoutePoint>& route) = 0;
  virtual std::uint64_t upload_fence(const DroneFence& fence) = 0;
  /// The operator has looked and goes on after `taken_over`.
  virtual void take_back() = 0;
  /// A person says that the aircraft on the link is another one: that of `sender`, or, empty, the next one
  /// whose autopilot is heard.
  virtual void change_peer(const std::string& sender) { (void)sender; }
  virtual DroneStatus status() const = 0;
  virtual std::vector<CommandReport> take_reports() = 0;
};

}  // namespace anchord
