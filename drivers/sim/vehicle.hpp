#pragma once

#include <Eigen/Core>
#include <optional>

namespace anchord::sim {

/// How a simulated multicopter flies and what disturbs it.
struct VehicleOptions {
  double max_speed_mps = 2.0, max_climb_mps = 1.5, acceleration_mps2 = 1.5;
  double yaw_rate_rad_s = 0.6;
  Eigen::Vector3d wind_mps{0, 0, 0};
  double wind_push = 0.15;  ///< share of the wind that the control does not take out: metres off per m/s
  double battery_s = 1200;  ///< of flight on a full battery
  double ground_m = 0;
};

/// A point that flies: first-order control with limits on speed, climb and acceleration. Metres east, north,
/// up; headings clockwise from north. No clock and no randomness of its own.
class Vehicle {
 public:
  enum class Mode : unsigned char { ground, take_off, guided, hold, return_home, land };

  Vehicle(const VehicleOptions& options, const Eigen::Vector3d& home_m, double heading_rad);

  void arm() { armed_ = true; }
  void disarm();  ///< on the ground only
  void take_off(double height_m);
  void go_to(const Eigen::Vector3d& point_m, std::optional<double> heading_rad);
  void hold();
  void return_home();
  void land();                                   ///< where it is
  void land_at(const Eigen::Vector2d& place_m);  ///< going there while it sinks
  void set_speed(double mps) { options_.max_speed_mps = mps; }
  void set_battery(double share) { battery_ = share; }
  void set_wind(const Eigen::Vector3d& mps) { options_.wind_mps = mps; }

  /// At most 0.1 s at a time keeps the control stable.
  void advance(double seconds);

  Eigen::Vector3d position_m() const;
  Eigen::Vector3d velocity_mps() const { return velocity_; }
  double heading_rad() const { return heading_; }
  double battery() const { return battery_; }
  bool armed() const { return armed_; }
  bool in_air() const { return mode_ != Mode::ground; }
  Mode mode() const { return mode_; }
  const Eigen::Vector3d& home_m() const { return home_; }

 private:
  VehicleOptions options_;
  Eigen::Vector3d home_, position_, velocity_{0, 0, 0}, target_;
  double heading_, wanted_heading_;
  double battery_{1};
  bool armed_{false};
  Mode mode_{Mode::ground};
};

}  // namespace anchord::sim
