#include "core/planning/walls.hpp"

#include <cmath>

namespace anchord::planning {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

std::vector<WallHit> hits_between(std::span<const BuiltWall> walls, const Eigen::Vector3d& a_m,
                                  const Eigen::Vector3d& b_m) {
  std::vector<WallHit> out;
  const Eigen::Vector3d way = b_m - a_m;
  const Eigen::Vector2d flat = way.head<2>();
  const double length = way.norm();
  const double low = std::min(a_m.z(), b_m.z()), high = std::max(a_m.z(), b_m.z());
  for (const BuiltWall& wall : walls) {
    if (wall.bottom_m > high || wall.top_m < low) continue;  // most walls of a house are on another floor
    const Eigen::Vector2d side = wall.to_m - wall.from_m;
    const double across = cross(flat, side);
    if (std::abs(across) < 1e-12) continue;
    const Eigen::Vector2d begin = wall.from_m - a_m.head<2>();
    const double share = cross(begin, side) / across, along = cross(begin, flat) / across;
    if (share <= 0 || share >= 1 || along < 0 || along > 1) continue;
    const double height_m = a_m.z() + share * way.z();
    if (height_m < wall.bottom_m || height_m > wall.top_m) continue;
    const double slant = wall_slant(std::abs(across) / side.norm() / length);
    out.push_back({share, wall_excess_m(wall) * slant, properties_of(wall.material).loss_db * slant});
  }
  return out;
}

Obstruction obstruction_between(std::span<const BuiltWall> walls, const Eigen::Vector3d& a_m,
                                const Eigen::Vector3d& b_m) {
  Obstruction out;
  for (const WallHit& hit : hits_between(walls, a_m, b_m)) {
    out.excess_m += hit.excess_m;
    out.loss_db += hit.loss_db;
    ++out.n;
  }
  return out;
}

double p_nlos_of_loss(double loss_db) { return 1.0 - std::pow(10.0, -loss_db / 10.0); }

}  // namespace anchord::planning
