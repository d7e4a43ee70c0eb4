#include "core/planning/walls.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/cross.hpp"

namespace anchord::planning {
namespace {

/// Most walls of a house are.
bool on_another_floor(const BuiltWall& wall, double low_m, double high_m) {
  return wall.bottom_m > high_m || wall.top_m < low_m;
}

/// Where the way meets a wall as seen from above.
struct Crossing {
  double share{};   ///< of the way
  double across{};  ///< its length times the wall's, times the sine between them
  double side_m{};  ///< length of the wall
};

std::optional<Crossing> crossing_of(const BuiltWall& wall, const Eigen::Vector2d& a_m,
                                    const Eigen::Vector2d& b_m) {
  const Eigen::Vector2d way = b_m - a_m, side = wall.to_m - wall.from_m;
  const double across = cross(way, side);
  if (std::abs(across) < 1e-12) return std::nullopt;
  const Eigen::Vector2d begin = wall.from_m - a_m;
  const double share = cross(begin, side) / across, along = cross(begin, way) / across;
  if (share <= 0 || share >= 1 || along < 0 || along > 1) return std::nullopt;
  return Crossing{share, across, side.norm()};
}

std::optional<WallHit> hit_of(const BuiltWall& wall, const Crossing& crossing, const Eigen::Vector3d& a_m,
                              const Eigen::Vector3d& b_m) {
  const Eigen::Vector3d way = b_m - a_m;
  const double height_m = a_m.z() + crossing.share * way.z();
  if (height_m < wall.bottom_m || height_m > wall.top_m) return std::nullopt;
  const double slant = wall_slant(std::abs(crossing.across) / crossing.side_m / way.norm());
  return WallHit{crossing.share, wall_excess_m(wall) * slant, properties_of(wall.material).loss_db * slant};
}

}  // namespace

std::vector<WallHit> hits_between(std::span<const BuiltWall> walls, const Eigen::Vector3d& a_m,
                                  const Eigen::Vector3d& b_m) {
  std::vector<WallHit> out;
  const double low_m = std::min(a_m.z(), b_m.z()), high_m = std::max(a_m.z(), b_m.z());
  for (const BuiltWall& wall : walls) {
    if (on_another_floor(wall, low_m, high_m)) continue;
    const auto crossing = crossing_of(wall, a_m.head<2>(), b_m.head<2>());
    const auto hit = crossing ? hit_of(wall, *crossing, a_m, b_m) : std::nullopt;
    if (hit) out.push_back(*hit);
  }
  return out;
}

void obstructions_between(std::span<const BuiltWall> walls, const Eigen::Vector2d& a_m,
                          std::span<const double> z_m, const Eigen::Vector3d& b_m,
                          std::span<Obstruction> out) {
  std::ranges::fill(out, Obstruction{});
  if (z_m.empty()) return;
  const auto [lowest, highest] = std::ranges::minmax(z_m);
  const double low_m = std::min(lowest, b_m.z()), high_m = std::max(highest, b_m.z());
  for (const BuiltWall& wall : walls) {
    if (on_another_floor(wall, low_m, high_m)) continue;
    const auto crossing = crossing_of(wall, a_m, b_m.head<2>());
    if (!crossing) continue;
    for (std::size_t i = 0; i < z_m.size(); ++i) {
      const auto hit = hit_of(wall, *crossing, {a_m.x(), a_m.y(), z_m[i]}, b_m);
      if (!hit) continue;
      out[i].excess_m += hit->excess_m;
      out[i].loss_db += hit->loss_db;
      ++out[i].n;
    }
  }
}

Obstruction obstruction_between(std::span<const BuiltWall> walls, const Eigen::Vector3d& a_m,
                                const Eigen::Vector3d& b_m) {
  Obstruction out;
  obstructions_between(walls, a_m.head<2>(), {&a_m.z(), 1}, b_m, {&out, 1});
  return out;
}

double p_nlos_of_loss(double loss_db) { return 1.0 - std::pow(10.0, -loss_db / 10.0); }

}  // namespace anchord::planning
