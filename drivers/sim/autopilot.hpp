#pragma once

#include <cstdint>
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
  double geoid_m = 44;             ///< ellipsoid above mean sea level: what GLOBAL_POSITION_INT leaves out
  double ready_s = 25;             ///< until the pre-arm checks pass, as on the real thing
  bool keeps_fences = true;        ///< false: refuses fence lists as unsupported
  double link_loss_s = 5;          ///< without a station's heartbeat: returns
  double loss = 0, duplicate = 0;  ///< chance of each frame it sends to be lost, to be sent twice
  std::uint64_t seed = 1;
  std::int64_t start_unix_us =
      1'777'888'800'000'000;  ///< its clock when it was switched on: signatures carry it
  std::optional<mavlink::Secret> secret{};
};

/// A copter that speaks MAVLink as ArduPilot or PX4 do: heartbeat, telemetry, modes, arming, take-off,
/// targets with yaw, hold, return, land, mission and fence lists, status texts, link failsafe. Bytes and time
/// in, bytes out: in a test faster than real time, behind a socket as if it were one.
class AutopilotSim {
 public:
  explicit AutopilotSim(AutopilotOptions options);

  void feed(std::span<const std::uint8_t> bytes);
  /// Flies on until now_s and sends what is due.
  void advance(double now_s);
  std::vector<std::uint8_t> take_bytes();

  Vehicle& vehicle() { return vehicle_; }
  void pilot_takes_over(std::uint32_t custom_mode) { set_mode(custom_mode); }  ///< with the remote control
  void set_silent(bool silent) { silent_ = silent; }
  std::uint32_t custom_mode() const { return custom_mode_; }
  bool failsafe() const { return failsafe_; }
  const std::vector<mavlink::Message>& mission_list() const { return mission_; }
  const std::vector<mavlink::Message>& fence_list() const { return fence_; }

 private:
  void handle(const mavlink::Message& m, mavlink::Address from);
  int run_command(const mavlink::Message& m);
  int arm(bool on);
  int take_off(double param7);
  bool set_mode(std::uint32_t custom_mode);
  void target(double lat_deg, double lon_deg, double height_m, std::optional<double> heading_rad);
  void lists(const mavlink::Message& m, mavlink::Address from);
  void send(const mavlink::Message& m);
  void text(int severity, const std::string& words);
  void telemetry();
  Wgs84 place(const Eigen::Vector3d& enu_m) const;
  Eigen::Vector3d metres(double lat_deg, double lon_deg) const;

  AutopilotOptions options_;
  Vehicle vehicle_;
  mavlink::Framer framer_;
  mavlink::Packer packer_;
  Random random_;
  std::vector<std::uint8_t> out_;
  double now_s_{0}, sent_fast_s_{-1}, sent_slow_s_{-1};
  std::optional<double> station_s_;
  std::uint32_t custom_mode_{0};
  bool failsafe_{false}, silent_{false}, ready_told_{false};
  std::vector<mavlink::Message> mission_, fence_;
  std::size_t wanted_{0};
  int uploading_{-1};  ///< list that is being taken in
};

}  // namespace anchord::sim
