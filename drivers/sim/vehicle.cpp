#include "drivers/sim/vehicle.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord::sim {

Vehicle::Vehicle(const VehicleOptions& options, const Eigen::Vector3d& home_m, double heading_rad)
    : options_(options),
      home_(home_m),
      position_(home_m),
      target_(home_m),
      heading_(heading_rad),
      wanted_heading_(heading_rad) {}

void Vehicle::disarm() {
  if (mode_ == Mode::ground) armed_ = false;
}

void Vehicle::take_off(double height_m) {
  if (!armed_ || mode_ != Mode::ground) return;
  mode_ = Mode::take_off;
  target_ = {position_.x(), position_.y(), home_.z() + height_m};
}

void Vehicle::go_to(const Eigen::Vector3d& point_m, std::optional<double> heading_rad) {
  if (mode_ == Mode::ground) return;
  mode_ = Mode::guided;
  target_ = point_m;
  if (heading_rad) wanted_heading_ = *heading_rad;
}

void Vehicle::hold() {
  if (mode_ == Mode::ground) return;
  mode_ = Mode::hold;
  target_ = position_;
}

void Vehicle::return_home() {
  if (mode_ == Mode::ground) return;
  mode_ = Mode::return_home;
  target_ = {home_.x(), home_.y(), std::max(position_.z(), home_.z() + 4)};
}

void Vehicle::land() { land_at(position_.head<2>()); }

void Vehicle::land_at(const Eigen::Vector2d& place_m) {
  if (mode_ == Mode::ground) return;
  mode_ = Mode::land;
  target_ = {place_m.x(), place_m.y(), options_.ground_m - 1};
}

Eigen::Vector3d Vehicle::position_m() const {
  return mode_ == Mode::ground ? position_
                               : Eigen::Vector3d(position_ + options_.wind_push * options_.wind_mps);
}

void Vehicle::advance(double seconds) {
  if (mode_ == Mode::ground) return;
  battery_ = std::max(0.0, battery_ - seconds / options_.battery_s);
  const Eigen::Vector3d away = target_ - position_;
  // Braking distance v^2 / 2a decides how fast it may still be.
  Eigen::Vector3d wanted = away.normalized() * std::min(options_.max_speed_mps,
                                                        std::sqrt(options_.acceleration_mps2 * away.norm()));
  if (away.norm() < 1e-6) wanted.setZero();
  wanted.z() = std::clamp(wanted.z(), -options_.max_climb_mps, options_.max_climb_mps);
  const Eigen::Vector3d change = wanted - velocity_;
  const double most = options_.acceleration_mps2 * seconds;
  velocity_ += change.norm() > most ? Eigen::Vector3d(change.normalized() * most) : change;
  position_ += velocity_ * seconds;
  const double turn = std::remainder(wanted_heading_ - heading_, 2 * std::numbers::pi);
  heading_ += std::clamp(turn, -options_.yaw_rate_rad_s * seconds, options_.yaw_rate_rad_s * seconds);
  heading_ = std::fmod(heading_ + 2 * std::numbers::pi, 2 * std::numbers::pi);
  if (mode_ == Mode::return_home && (position_ - target_).norm() < 0.3) land();
  if (position_.z() > options_.ground_m) return;
  position_.z() = options_.ground_m;  // wherever it aims
  velocity_.z() = std::max(0.0, velocity_.z());
  if (mode_ != Mode::land) return;
  velocity_.setZero();
  mode_ = Mode::ground;
  armed_ = false;
}

}  // namespace anchord::sim
