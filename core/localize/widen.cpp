#include "core/localize/widen.hpp"

#include <Eigen/Dense>
#include <cmath>

namespace anchord {
namespace {

int axes_of(Dims dims) { return dims == Dims::two ? 2 : 3; }

}  // namespace

void reach(const Eigen::Vector4d& moved, Dims dims, Eigen::Matrix4d& covariance_m2) {
  const int n = axes_of(dims);
  const Eigen::MatrixXd position = covariance_m2.topLeftCorner(n, n);
  const double sigmas2 = moved.head(n).dot(position.ldlt().solve(moved.head(n)));
  if (!(sigmas2 > 1.0) || !moved.allFinite()) return;
  covariance_m2 += (1.0 - 1.0 / sigmas2) * moved * moved.transpose();
}

void widen_in_plane(double sigma_m, Eigen::Matrix4d& covariance_m2) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance_m2.topLeftCorner<2, 2>());
  const Eigen::Vector2d lacking_m2 = (sigma_m * sigma_m - axes.eigenvalues().array()).max(0.0).matrix();
  if (!lacking_m2.allFinite()) return;
  covariance_m2.topLeftCorner<2, 2>() +=
      axes.eigenvectors() * lacking_m2.asDiagonal() * axes.eigenvectors().transpose();
}

void hold(const Eigen::Matrix3d& least_m2, Dims dims, Eigen::Matrix4d& covariance_m2) {
  const int n = axes_of(dims);
  const Eigen::LLT<Eigen::MatrixXd> root(covariance_m2.topLeftCorner(n, n));
  if (root.info() != Eigen::Success || !least_m2.allFinite()) return;
  // In units of what is claimed: whatever is larger than one is lacking.
  const Eigen::MatrixXd half = root.matrixL().solve(least_m2.topLeftCorner(n, n));
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(root.matrixL().solve(half.transpose()));
  const Eigen::MatrixXd ways = root.matrixL() * axes.eigenvectors();
  covariance_m2.topLeftCorner(n, n) +=
      ways * (axes.eigenvalues().array() - 1.0).max(0.0).matrix().asDiagonal() * ways.transpose();
}

bool much_wider(const Eigen::Matrix4d& now_m2, const Eigen::Matrix4d& before_m2, Dims dims) {
  const int n = axes_of(dims);
  return now_m2.topLeftCorner(n, n).trace() > 1.21 * before_m2.topLeftCorner(n, n).trace();
}

}  // namespace anchord
