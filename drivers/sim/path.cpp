#include "drivers/sim/path.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord::sim {
namespace {

double heading_of(const Eigen::Vector3d& step_m, double otherwise_rad) {
  return step_m.head<2>().norm() < 1e-9 ? otherwise_rad : std::atan2(step_m.x(), step_m.y());
}

}  // namespace

Eigen::Quaterniond Pose::enu_from_body() const {
  return Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2 - heading_rad, Eigen::Vector3d::UnitZ()));
}

FlightPath::FlightPath(std::vector<PathPoint> points, double speed_mps, bool loop) : loop_(loop) {
  double heading_rad = points.size() > 1 ? heading_of(points[1].enu_m - points[0].enu_m, 0) : 0;
  const std::size_t count = loop && points.size() > 1 ? points.size() + 1 : points.size();
  for (std::size_t i = 0; i < count; ++i) {
    const PathPoint& to = points[i % points.size()];
    const Eigen::Vector3d from_m = i == 0 ? to.enu_m : points[i - 1].enu_m;
    heading_rad = to.heading_rad.value_or(heading_of(to.enu_m - from_m, heading_rad));
    // The closing leg leads to the first point, whose hold begins the next round.
    const double hold_s = i == points.size() ? 0 : to.hold_s;
    const Leg leg{end_s_, (to.enu_m - from_m).norm() / speed_mps, hold_s, from_m, to.enu_m, heading_rad,
                  to.turn};
    legs_.push_back(leg);
    end_s_ += leg.fly_s + leg.hold_s;
  }
}

Pose FlightPath::at(double time_s) const {
  double t = std::max(time_s, 0.0);
  if (loop_ && end_s_ > 0) t = std::fmod(t, end_s_);
  auto leg = std::upper_bound(legs_.begin(), legs_.end(), t,
                              [](double time, const Leg& other) { return time < other.start_s; });
  if (leg != legs_.begin()) --leg;
  Pose pose;
  pose.heading_rad = leg->heading_rad;
  const double into_s = t - leg->start_s;
  if (into_s < leg->fly_s) {
    pose.enu_m = leg->from_m + into_s / leg->fly_s * (leg->to_m - leg->from_m);
    pose.velocity_mps = (leg->to_m - leg->from_m) / leg->fly_s;
    return pose;
  }
  pose.enu_m = leg->to_m;
  const double held = leg->hold_s > 0 ? std::min((into_s - leg->fly_s) / leg->hold_s, 1.0) : 0.0;
  if (leg->turn) pose.heading_rad += 2 * std::numbers::pi * held;
  return pose;
}

std::vector<PathPoint> ring_path(const Eigen::Vector2d& corner_m, const Eigen::Vector2d& opposite_m,
                                 double clearance_m, const std::vector<double>& heights_m) {
  const Eigen::Vector2d low_m = corner_m.cwiseMin(opposite_m), high_m = corner_m.cwiseMax(opposite_m);
  const double c = clearance_m;
  // Counter-clockwise from the middle of the south side, so that a ring starts away from its corners.
  const std::vector<Eigen::Vector2d> ring{{(low_m.x() + high_m.x()) / 2, low_m.y() - c},
                                          {high_m.x(), low_m.y() - c},
                                          {high_m.x() + c, low_m.y()},
                                          {high_m.x() + c, high_m.y()},
                                          {high_m.x(), high_m.y() + c},
                                          {low_m.x(), high_m.y() + c},
                                          {low_m.x() - c, high_m.y()},
                                          {low_m.x() - c, low_m.y()},
                                          {low_m.x(), low_m.y() - c},
                                          {(low_m.x() + high_m.x()) / 2, low_m.y() - c}};
  std::vector<PathPoint> points;
  for (const double height_m : heights_m) {
    for (const Eigen::Vector2d& at_m : ring) {
      PathPoint point;
      point.enu_m = {at_m.x(), at_m.y(), height_m};
      points.push_back(point);
    }
  }
  return points;
}

void LiveMover::go_to(const Eigen::Vector3d& enu_m, std::optional<double> heading_rad) {
  goal_m_ = enu_m;
  pose_.heading_rad = heading_rad.value_or(heading_of(goal_m_ - pose_.enu_m, pose_.heading_rad));
}

Pose LiveMover::at(double time_s) {
  const double step_s = std::max(time_s - last_s_, 0.0);
  last_s_ = std::max(last_s_, time_s);
  const Eigen::Vector3d way_m = goal_m_ - pose_.enu_m;
  const double left_m = way_m.norm();
  if (left_m < 1e-9) {
    pose_.velocity_mps.setZero();
    return pose_;
  }
  pose_.velocity_mps = way_m / left_m * speed_mps_;
  pose_.enu_m += way_m * std::min(1.0, step_s * speed_mps_ / left_m);
  return pose_;
}

}  // namespace anchord::sim
