#include "drivers/sim/pozyx_position.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/base/median.hpp"

namespace anchord::sim {
namespace {

struct Found {
  TagPosition position;
  double squares_m2{};
};

/// From one start; n unknowns.
std::optional<Found> search(std::span<const AnchorRange> anchors, Eigen::Index n,
                            const Eigen::Vector3d& start_m) {
  Found out{{start_m}, 0};
  for (int round = 0; round < 50; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    out.squares_m2 = 0;
    for (const AnchorRange& anchor : anchors) {
      const Eigen::Vector3d line_m = out.position.at_m - anchor.at_m;
      const double distance_m = std::max(line_m.norm(), 1e-6);
      const Eigen::Vector3d direction = line_m / distance_m;
      const double residual_m = distance_m - anchor.range_m;
      normal += direction * direction.transpose();
      gradient += direction * residual_m;
      out.squares_m2 += residual_m * residual_m;
    }
    const Eigen::MatrixXd searched = normal.topLeftCorner(n, n);
    if (Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(searched).eigenvalues()(0) < 1e-4) return std::nullopt;
    const Eigen::MatrixXd damped = searched + 1e-3 * Eigen::MatrixXd::Identity(n, n);
    const Eigen::VectorXd step = damped.ldlt().solve(gradient.head(n));
    out.position.at_m.head(n) -= step;
    if (step.norm() > 1e-4) continue;
    const double spare = std::max(1.0, static_cast<double>(anchors.size()) - static_cast<double>(n));
    out.position.covariance_m2.topLeftCorner(n, n) = searched.inverse() * (out.squares_m2 / spare);
    return out;
  }
  return std::nullopt;
}

}  // namespace

std::optional<TagPosition> tag_position(std::span<const AnchorRange> anchors, bool solve_z, double height_m) {
  const Eigen::Index unknowns = solve_z ? 3 : 2;
  if (static_cast<Eigen::Index>(anchors.size()) < unknowns + 1) return std::nullopt;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (const AnchorRange& anchor : anchors) middle_m += anchor.at_m / static_cast<double>(anchors.size());
  // Anchors of about one height leave a mirror solution on their other side: the better of the two, the lower
  // in doubt.
  std::optional<Found> best;
  for (const double from_middle_m : {-2.0, 2.0}) {
    const double z_m = solve_z ? middle_m.z() + from_middle_m : height_m;
    const auto found = search(anchors, unknowns, {middle_m.x(), middle_m.y(), z_m});
    if (found && (!best || found->squares_m2 < 0.9 * best->squares_m2)) best = found;
    if (!solve_z) break;
  }
  if (!best) return std::nullopt;
  return best->position;
}

Eigen::Vector3d filter_position(std::span<const Eigen::Vector3d> newest_last, unsigned setting) {
  const std::size_t n = std::min<std::size_t>(newest_last.size(), 2 * (setting >> 4 & 0x0f) + 1);
  const auto window = newest_last.last(n);
  const unsigned kind = setting & 0x0f;
  if (kind == 4) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (const Eigen::Vector3d& at_m : window) values.push_back(at_m(axis));
      middle(axis) = upper_median(values);
    }
    return middle;
  }
  if (kind != 1 && kind != 3) return window.back();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double weights = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double weight = kind == 3 ? 1.0 : static_cast<double>(std::min(i + 1, n - i));
    sum += weight * window[i];
    weights += weight;
  }
  return sum / weights;
}

}  // namespace anchord::sim
