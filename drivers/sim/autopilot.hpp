#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/types/position.hpp"
#include "drivers/drone/dialect.hpp"
#include "drivers/mavlink/frame.hpp"
#include "drivers/sim/random.hpp"
#include "drivers/sim/vehicle.hpp"

namespace anchord::sim {

struct AutopilotOptions {
  drone::Autopilot dialect = drone::Autopilot::ardupilot;
  VehicleOptions vehicle{};
  Wgs84 origin{51.0231, 3.7131, 55.5};  ///< of the vehicle's metres; its home is at home_m
  Eigen::Vector3d home_m{0, 0, 0};
  double geoid_m = 44;        ///< ellipsoid above mean sea level: what GLOBAL_POSITION_INT leaves out
  double ready_s = 25;        ///< until the pre-arm checks pass, as on the real thing
  double cruise_mps = 8;      ///< its own speed in GUIDED until it is told another
  bool keeps_fences = true;   ///< false: refuses fence lists as unsupported
  bool old_streams = false;   ///< ArduPilot before 4.0: knows groups of messages and no 511
  bool old_requests = false;  ///< asks for items by MISSION_REQUEST, as before MISSION_REQUEST_INT
  /// Without a station's heartbeat for so long it returns; none: its default, 5 s (FS_GCS_TIMEOUT) or 10 s
  /// (COM_DL_LOSS_T).
  std::optional<double> link_loss_s{};
  double loss = 0, duplicate = 0;  ///< chance of each frame it sends to be lost, to be sent twice
  double loss_in = 0;              ///< of each frame sent to it
  double latency_s = 0;            ///< of the link, each way
  double ack_delay_s = 0, ack_loss = 0;
  double mode_lag_s = 0;      ///< the heartbeat shows a mode so much later
  bool does_nothing = false;  ///< every command is acknowledged and none is done
  bool no_place = false;      ///< its estimator has no origin: latitude and longitude are 0
  /// What it believes of its place against the truth: ordinary GNSS, and a barometer that drifts.
  Eigen::Vector3d gnss_offset_m{0, 0, 0};
  double baro_drift_mps = 0, baro_drift_max_m = 10;
  bool battery_failsafe = false;  ///< returns below 15 %, lands below 5 %
  double sag_v = 0;               ///< its voltage is so much lower than its share of charge says
  std::uint64_t seed = 1;
  std::int64_t start_unix_us =
      1'777'888'800'000'000;  ///< its clock when it was switched on: signatures carry it
  std::optional<mavlink::Secret> secret{};
};

/// A copter that speaks MAVLink as ArduPilot or PX4 do: heartbeat, telemetry as asked for, modes, arming with
/// its checks, take-off, targets with yaw, hold, return, land, mission and fence lists, parameters, status
/// texts, failsafes. Bytes and time in, bytes out: in a test faster than real time, behind a socket as if it
/// were one. What is taken from where: drivers/sim/autopilot.md.
class AutopilotSim {
 public:
  explicit AutopilotSim(AutopilotOptions options);

  void feed(std::span<const std::uint8_t> bytes);
  /// Flies on until now_s and sends what is due.
  void advance(double now_s);
  std::vector<std::uint8_t> take_bytes();

  // What happens to it, at any moment.
  void pilot_takes_over(std::uint32_t custom_mode);  ///< with the remote control
  void pilot_lands();                                ///< by hand, and disarms
  enum class Failsafe : std::uint8_t { radio, battery, ekf, station };
  void fail(Failsafe failsafe);
  bool restart();                              ///< battery swap: on the ground only
  void refuse_arming(const std::string& why);  ///< empty: no longer
  void set_silent(bool silent) { silent_ = silent; }
  void be_silent(double seconds) { silent_until_s_ = now_s_ + seconds; }
  void set_battery_warning(int charge_state) { charge_state_ = charge_state; }
  void set_parameter(const std::string& name, double value) { parameters_[name].value = value; }
  AutopilotOptions& options() { return options_; }

  Vehicle& vehicle() { return vehicle_; }
  const Vehicle& vehicle() const { return vehicle_; }
  std::uint32_t custom_mode() const { return custom_mode_; }
  bool failsafe() const { return failsafe_; }
  double now_s() const { return now_s_; }
  /// Where it would stand if it reached what it aims at, in truth.
  std::optional<Eigen::Vector3d> aim_m() const;
  /// Where the target of message 86 or command 192 would bring it, in truth.
  Eigen::Vector3d asked_m(const mavlink::Message& target) const;
  const std::vector<mavlink::Message>& mission_list() const { return mission_; }
  const std::vector<mavlink::Message>& fence_list() const { return fence_; }

 private:
  struct Late {
    double due_s{};
    std::vector<std::uint8_t> bytes;
  };
  struct Parameter {
    double value{};
    bool whole{false};
  };

  void receive(std::span<const std::uint8_t> bytes);
  void handle(const mavlink::Message& m, mavlink::Address from);
  int run_command(const mavlink::Message& m);
  int set_interval(const mavlink::Message& m);
  void set_group(const mavlink::Message& m);
  int arm(bool on);
  int take_off(double param7);
  int reposition(const mavlink::Message& m);
  bool armable() const;
  std::string not_ready() const;
  void set_mode(std::uint32_t custom_mode);
  void fly(double seconds);
  void watch_failsafes();
  void target(double lat_deg, double lon_deg, double above_home_m, std::optional<double> heading_rad);
  void lists(const mavlink::Message& m, mavlink::Address from);
  void parameter(const mavlink::Message& m);
  void send(const mavlink::Message& m, double delay_s = 0);
  void text(int severity, const std::string& words);
  void telemetry();
  mavlink::Message telemetry_message(int id) const;
  Eigen::Vector3d error_m() const;
  Eigen::Vector3d believed_m() const { return vehicle_.position_m() + error_m(); }
  Wgs84 place(const Eigen::Vector3d& enu_m) const;
  Eigen::Vector3d metres(double lat_deg, double lon_deg) const;

  AutopilotOptions options_;
  Vehicle vehicle_;
  mavlink::Framer framer_;
  mavlink::Packer packer_;
  Random random_;
  std::deque<Late> in_, out_;
  double now_s_{0}, boot_s_{0}, airborne_s_{0};
  std::map<int, double> intervals_, next_s_;
  std::optional<double> station_s_, armed_s_;
  std::uint32_t custom_mode_{0}, shown_mode_{0};
  double silent_until_s_{0}, mode_s_{0}, prearm_told_s_{-100};
  bool failsafe_{false}, silent_{false}, ready_told_{false}, returning_{false};
  std::string refusal_;
  int charge_state_{0};
  Eigen::Vector3d home_m_;                ///< as it believes
  std::optional<Eigen::Vector3d> aim_m_;  ///< as it believes; none: on the ground, or the vehicle's own way
  std::optional<double> heading_;
  std::map<std::string, Parameter> parameters_;
  std::vector<mavlink::Message> mission_, fence_;
  std::size_t wanted_{0};
  int uploading_{-1};  ///< list that is being taken in
};

}  // namespace anchord::sim
