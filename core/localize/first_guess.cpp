#include "core/localize/first_guess.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace anchord {
namespace {

double in_plane(double distance_m, double rise_m) {
  return std::sqrt(std::max(0.0, distance_m * distance_m - rise_m * rise_m));
}

}  // namespace

Eigen::Vector3d first_guess(const Eigen::Vector3d& tag_m, double distance_m, double bearing_rad,
                            double height_m) {
  const double d = in_plane(distance_m, height_m - tag_m.z());
  return {tag_m.x() + d * std::sin(bearing_rad), tag_m.y() + d * std::cos(bearing_rad), height_m};
}

Result<Eigen::Vector3d> second_guess(const Eigen::Vector3d& tag1_m, double distance1_m,
                                     const Eigen::Vector3d& tag2_m, double distance2_m, double height_m,
                                     const Eigen::Vector3d& guess_m, double slack_m) {
  const Eigen::Vector2d a = tag1_m.head<2>(), between = tag2_m.head<2>() - a;
  const double apart = between.norm();
  if (!(apart > 1e-3))
    return make_error(Errc::weak_geometry, "both ranges are from the same place in the plane");
  const double r1 = in_plane(distance1_m, height_m - tag1_m.z()),
               r2 = in_plane(distance2_m, height_m - tag2_m.z());
  const double miss = std::max(apart - r1 - r2, std::abs(r1 - r2) - apart);
  if (!(miss <= slack_m)) {
    return make_error(Errc::no_convergence,
                      "the two ranges miss each other by " + std::to_string(miss) + " m");
  }
  const double along = (apart * apart + r1 * r1 - r2 * r2) / (2 * apart);
  const double across = in_plane(r1, along);
  const Eigen::Vector2d unit = between / apart, left{-unit.y(), unit.x()}, foot = a + along * unit;
  const double side = (guess_m.head<2>() - foot).dot(left) >= 0 ? 1 : -1;
  const Eigen::Vector2d p = foot + side * across * left;
  return Eigen::Vector3d(p.x(), p.y(), height_m);
}

Eigen::Vector3d guess_from_turn(std::span<const Observation> rows, const Eigen::Vector3d& turn_m,
                                double bearing_rad, double height_m) {
  const auto away = [&](const Observation& o) { return (o.tag_m - turn_m).norm(); };
  const Observation& nearest = *std::ranges::min_element(rows, {}, away);
  const Eigen::Vector3d guess_m = first_guess(turn_m, nearest.distance_m, bearing_rad, height_m);
  const Eigen::Vector2d right(std::cos(bearing_rad), -std::sin(bearing_rad));
  const auto aside = [&](const Observation& o) {
    return std::abs(right.dot((o.tag_m - nearest.tag_m).head<2>()));
  };
  const Observation& other = *std::ranges::max_element(rows, {}, aside);
  const auto second =
      second_guess(nearest.tag_m, nearest.distance_m, other.tag_m, other.distance_m, height_m, guess_m);
  const bool near = second && (second.value() - guess_m).norm() <= 0.7 * nearest.distance_m;
  return near ? second.value() : guess_m;
}

}  // namespace anchord
