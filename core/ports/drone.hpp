#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/types/plan.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// What became of a command to the aircraft.
enum class CommandState : std::uint8_t {
  sent,
  accepted,     ///< seen to be done; of what cannot be seen: acknowledged
  refused,      ///< by the autopilot, with its reason
  unconfirmed,  ///< not within 2 s, acknowledged or not: an alarm; never repeated by itself after that
};
inline constexpr auto k_command_state_words =
    enum_table<CommandState>({{"sent", CommandState::sent},
                              {"accepted", CommandState::accepted},
                              {"refused", CommandState::refused},
                              {"unconfirmed", CommandState::unconfirmed}});
constexpr std::string_view to_string(CommandState state) { return k_command_state_words.word(state); }

struct CommandReport {
  std::uint64_t number{};
  std::string what;  ///< take_off, go_to, hold, return_home, land, upload
  CommandState state{};
  std::string text;
};

/// Who this station is on the link, in MAVLink; QGroundControl is the same as it comes. 255: what ArduPilot's
/// failsafe listens to by default.
inline constexpr int k_station_system = 255, k_station_component = 190;

/// Somebody else on the aircraft's link: another vehicle, a ground station, a datagram of a stranger. Counted
/// and shown, never obeyed.
struct OtherOnLink {
  std::string sender;  ///< address and port; empty: the aircraft's own end of the link
  int system{}, component{};
  /// autopilot, fixed wing, VTOL, ground vehicle, boat, submarine, antenna tracker, other vehicle, ground
  /// station, gimbal, camera, other; of frames that were refused: unsigned, wrong key, clock behind,
  /// replayed, no MAVLink
  std::string kind;
  std::uint64_t frames{};
  double silent_s{};
};

/// What the autopilot's mode means to us; `other`: a pilot's, or one that nobody here commands.
enum class ModeKind : std::uint8_t { other, guided, hold, return_home, land };

/// Which aircraft of a link is ours.
struct DroneIdentity {
  std::string peer;           ///< address and port where the link has senders (UDP)
  int system{}, component{};  ///< MAVLink ids; system 0: none was heard
};

/// How the aircraft is, as its autopilot tells. Ages in seconds; infinity: never.
struct DroneStatus {
  bool connected{false};  ///< heard within the last 3 s
  double silent_s{};
  double mode_age_s{};    ///< of the heartbeat, which alone shows the mode
  std::string autopilot;  ///< "ArduPilot", "PX4" or empty
  std::string mode;       ///< word of the autopilot's mode
  ModeKind mode_kind{};
  bool armed{false}, failsafe{false};
  bool in_air{false};  ///< armed and not said to stand on the ground: what is not known counts as flying
  bool taken_over{
      false};  ///< somebody else changed the mode: no target is sent until the operator starts anew
  std::optional<Wgs84> position{};     ///< height_m above the ellipsoid where known, else above sea level
  std::optional<double> relative_m{};  ///< above home
  std::optional<double> heading_deg{}, speed_mps{}, battery{};
  std::optional<Wgs84> home{};
  int gps_fix{};     ///< MAVLink's number: 5 RTK float, 6 RTK fixed
  std::string text;  ///< newest warning of the autopilot
  double position_age_s{std::numeric_limits<double>::infinity()};
  double battery_age_s{std::numeric_limits<double>::infinity()};
  /// Telemetry that is older than 5 s although the autopilot is heard: nothing may be judged by it.
  std::vector<std::string> stale;
  std::vector<std::string> streams_refused;  ///< by the autopilot, when it was asked for them: name, result
  std::optional<bool> ready_to_arm{};        ///< the autopilot's own pre-arm checks
  std::string not_ready;                     ///< why not, in its words
  std::optional<double> battery_v{};
  int battery_warning{};  ///< the autopilot's own: 0 none, 1 low, 2 critical
  /// Values of the parameters that were asked for; those it does not know are absent.
  std::map<std::string, double> parameters;
  std::vector<std::string> parameters_unknown;  ///< asked five times in vain
  DroneIdentity identity{};
  bool link_signed{false};         ///< frames without our key's signature are refused
  std::uint64_t frames_refused{};  ///< unsigned, badly signed, or signed a second time
  std::vector<OtherOnLink> others;
  /// Why nobody is followed, or that two autopilots answer as one; empty: nothing is wrong with who is heard.
  std::string link_trouble;
  std::string link_fault;  ///< why nobody can be heard, as far as the link itself shows; empty: it does not
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
///
/// Targets and take-off belong to a flight: new_flight() begins one with nothing of the one before,
/// end_flight() ends it, and outside of one neither is sent. Hold, return, land and disarm are always sent.
class Drone {
 public:
  virtual ~Drone() = default;
  /// `speed_mps`: of the targets that follow.
  virtual void new_flight(double speed_mps) = 0;
  /// Whatever waits is dropped and reported; what was armed for it and still stands on the ground is
  /// disarmed.
  virtual void end_flight() = 0;
  virtual std::uint64_t take_off(double above_ground_m) = 0;  ///< from where it stands
  virtual std::uint64_t go_to(double lat_deg, double lon_deg, double height_m,
                              std::optional<double> heading_deg) = 0;
  /// Corrects the target that is being flown to; without one nothing happens. Not reported.
  virtual void steer(double lat_deg, double lon_deg, double height_m) = 0;
  virtual std::uint64_t hold() = 0;
  virtual std::uint64_t return_home() = 0;
  virtual std::uint64_t land() = 0;
  virtual std::uint64_t disarm() = 0;  ///< never by force: in the air the autopilot refuses it
  /// Both replace what the autopilot kept, are read back and compared: accepted means that it keeps them.
  /// They take seconds; unconfirmed after five questions without an answer.
  virtual std::uint64_t upload_route(const std::vector<RoutePoint>& route) = 0;
  virtual std::uint64_t upload_fence(const DroneFence& fence) = 0;
  /// Values come into the status; asked again after the autopilot was restarted.
  virtual void ask_parameters(const std::vector<std::string>& names) = 0;
  /// The operator has looked and goes on after `taken_over`, from the mode that is shown.
  virtual void take_back() = 0;
  /// A person says that the aircraft on the link is another one: that of `sender`, or, empty, the next one
  /// whose autopilot is heard.
  virtual void change_peer(const std::string& sender) { (void)sender; }
  /// A flight goes on after a restart: nobody but its aircraft is taken, until a person changes it.
  virtual void expect(const DroneIdentity& aircraft) { (void)aircraft; }
  virtual DroneStatus status() const = 0;
  virtual std::vector<CommandReport> take_reports() = 0;
};

}  // namespace anchord
