#include "core/localize/held_height.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cstdio>
#include <limits>

#include "core/localize/joint_lines.hpp"
#include "core/localize/weighed_row.hpp"

namespace anchord {
namespace {

constexpr double k_most_sigma_m = 0.5;

double sigma_m(const FlightOptions& options) {
  return options.anchor_height_m ? options.anchor_height_sigma_m : k_unstated_height_sigma_m;
}

}  // namespace

Eigen::Matrix3d held_height_m2(const FlightRows& flight, const JointFit& fit, std::size_t index,
                               const FlightOptions& options) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const JointLines lines(flight.track, flight.anchors[index].rows, fit.state.shared,
                         fit.state.anchors[index]);
  Eigen::Vector4d by_height = Eigen::Vector4d::Zero();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const JointLine line = lines.line(i);
    const double per_m2 = weighed_row(*lines.rows()[i], line, block, block.scale_m, options).per_m2;
    by_height += per_m2 * line.by_anchor.z() * Eigen::Vector4d(line.by_anchor.x(), line.by_anchor.y(), 0, 1);
  }
  const Eigen::Vector4d moved = -block.own_inverse * by_height;
  const Eigen::Vector3d reach_m = sigma_m(options) * Eigen::Vector3d(moved.x(), moved.y(), 1);
  return reach_m * reach_m.transpose();
}

Gate held_height_gate(const FlightOptions& options) {
  if (!options.anchor_height_m)
    return {k_held_height_gate, std::nullopt, k_most_sigma_m, false,
            "the height of the anchors was not given, and in two dimensions no range measures it: it is held "
            "at the "
            "mean height of the track; give it (anchor_height_m), or solve in three dimensions"};
  char why[120];
  std::snprintf(why, sizeof why, "sigma of the given height, which is held: %.2f m", sigma_m(options));
  return {k_held_height_gate, sigma_m(options), k_most_sigma_m, sigma_m(options) <= k_most_sigma_m, why};
}

void hold_height_sigma(std::span<const Estimate* const> estimates, Eigen::Matrix3d& covariance_m2) {
  double stated_m2 = std::numeric_limits<double>::infinity();
  for (const Estimate* estimate : estimates) {
    if (std::ranges::find(estimate->gates, k_held_height_gate, &Gate::name) == estimate->gates.end()) return;
    stated_m2 = std::min(stated_m2, estimate->best->covariance_m2(2, 2));
  }
  const double now_m2 = covariance_m2(2, 2);
  if (estimates.empty() || !(now_m2 > 0) || stated_m2 <= now_m2) return;
  const Eigen::Vector3d along = covariance_m2.col(2) / now_m2;
  covariance_m2 += (stated_m2 - now_m2) * along * along.transpose();
}

}  // namespace anchord
