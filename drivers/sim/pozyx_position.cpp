#include "drivers/sim/pozyx_position.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace anchord::sim {

std::optional<TagPosition> tag_position(std::span<const AnchorRange> anchors, bool solve_z, double height_m) {
  const std::size_t unknowns = solve_z ? 3 : 2;
  if (anchors.size() < unknowns + 1) return std::nullopt;
  TagPosition out;
  for (const AnchorRange& anchor : anchors) out.at_m += anchor.at_m / static_cast<double>(anchors.size());
  out.at_m.z() = solve_z ? out.at_m.z() - 1.0 : height_m;
  const auto n = static_cast<Eigen::Index>(unknowns);
  for (int round = 0; round < 50; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    double squares_m2 = 0;
    for (const AnchorRange& anchor : anchors) {
      const Eigen::Vector3d line_m = out.at_m - anchor.at_m;
      const double distance_m = std::max(line_m.norm(), 1e-6);
      const Eigen::Vector3d direction = line_m / distance_m;
      const double residual_m = distance_m - anchor.range_m;
      normal += direction * direction.transpose();
      gradient += direction * residual_m;
      squares_m2 += residual_m * residual_m;
    }
    const Eigen::MatrixXd searched = normal.topLeftCorner(n, n);
    if (Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(searched).eigenvalues()(0) < 1e-4) return std::nullopt;
    const Eigen::MatrixXd damped = searched + 1e-3 * Eigen::MatrixXd::Identity(n, n);
    const Eigen::VectorXd step = damped.ldlt().solve(gradient.head(n));
    out.at_m.head(n) -= step;
    if (step.norm() > 1e-4) continue;
    const double spare = std::max(1.0, static_cast<double>(anchors.size()) - static_cast<double>(n));
    out.covariance_m2.topLeftCorner(n, n) = searched.inverse() * (squares_m2 / spare);
    return out;
  }
  return std::nullopt;
}

}  // namespace anchord::sim
