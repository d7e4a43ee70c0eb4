#include "core/planning/sight.hpp"

#include <algorithm>

namespace anchord::planning {
namespace {

constexpr double k_opaque = 2;

double joint_nlos(double drawn, double loss_db) {
  if (loss_db > k_opaque_db) return k_opaque;
  return 1.0 - (1.0 - drawn) * (1.0 - p_nlos_of_loss(loss_db));
}

std::optional<double> probability_of(double p) { return p == k_opaque ? std::nullopt : std::optional(p); }

bool has_walls(const NextPointInput& input) { return input.walls && !input.walls->empty(); }

}  // namespace

std::optional<double> expected_nlos(const NextPointInput& input, const Eigen::Vector3d& point_m,
                                    const Eigen::Vector3d& place_m) {
  const double drawn = p_nlos_through(input.bounds, point_m, place_m);
  if (!has_walls(input)) return drawn;
  return probability_of(joint_nlos(drawn, obstruction_between(*input.walls, point_m, place_m).loss_db));
}

Sights::Sights(const NextPointInput& input, const Grid& grid, std::size_t upward,
               const Eigen::Vector3d& place_m) {
  const bool drawn = std::ranges::any_of(input.bounds.walls, [](const Wall& w) { return w.p_nlos > 0; });
  if (!drawn && !has_walls(input)) return;
  p_nlos_.resize(grid.size());
  std::vector<Obstruction> through(upward);
  for (std::size_t begin = 0; begin < grid.size(); begin += upward) {
    const Eigen::Vector3d point = grid.at(begin);
    // Walls of the bounds stand from floor to sky.
    const double here = drawn ? p_nlos_through(input.bounds, point, place_m) : 0.0;
    std::fill_n(p_nlos_.begin() + static_cast<std::ptrdiff_t>(begin), upward, here);
    if (!has_walls(input)) continue;
    obstructions_between(*input.walls, point.head<2>(), std::span(grid.z_m).subspan(begin, upward), place_m,
                         through);
    for (std::size_t i = 0; i < upward; ++i) {
      if (through[i].n > 0) p_nlos_[begin + i] = joint_nlos(here, through[i].loss_db);
    }
  }
}

std::optional<double> Sights::operator[](std::size_t i) const {
  return p_nlos_.empty() ? std::optional(0.0) : probability_of(p_nlos_[i]);
}

}  // namespace anchord::planning
