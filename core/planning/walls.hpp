#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "core/types/wall.hpp"

namespace anchord::planning {

/// Walls that a person accepted, shared by all who plan with them; null: none are known.
using Walls = std::shared_ptr<const std::vector<BuiltWall>>;

/// One wall on the straight line between two points.
struct WallHit {
  double share{};  ///< of the way where it is met, 0..1
  double excess_m{}, loss_db{};
};

/// Walls that the line from `a` to `b` goes through. Touching an end of the wall, or its lower or upper edge,
/// counts; a line within the wall's plane does not, nor one that only begins or ends on it. The excess is the
/// extra optical path of a slab, the loss that of its material, both by the inverse cosine of the incidence
/// (core/types/wall.hpp), as in the simulated radio.
std::vector<WallHit> hits_between(std::span<const BuiltWall> walls, const Eigen::Vector3d& a_m,
                                  const Eigen::Vector3d& b_m);

/// All of them together.
struct Obstruction {
  double excess_m{};  ///< a range comes out long by so much
  double loss_db{};
  std::size_t n{};
};
Obstruction obstruction_between(std::span<const BuiltWall> walls, const Eigen::Vector3d& a_m,
                                const Eigen::Vector3d& b_m);
/// The same from points above one another: out[i] from (a, z[i]).
void obstructions_between(std::span<const BuiltWall> walls, const Eigen::Vector2d& a_m,
                          std::span<const double> z_m, const Eigen::Vector3d& b_m,
                          std::span<Obstruction> out);

/// More than this nothing gets through at any distance: what a DW1000 has left at one metre, -14.3 dBm sent,
/// 44.5 dB of the first metre, -102 dBm of sensitivity (docs/radio-model.md).
inline constexpr double k_opaque_db = 43;

/// Probability that a range through walls is not line of sight: the share of the direct path's power that
/// they take, 1 - 10^(-loss / 10). Losses add where probabilities of independent walls multiply, as those of
/// p_nlos_through() do.
double p_nlos_of_loss(double loss_db);

}  // namespace anchord::planning
