#include "core/localize/widen.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "core/base/axes.hpp"

namespace anchord {
namespace {

template <int N>
using Square = Eigen::Matrix<double, N, N>;

template <int N>
double sigmas2(const Eigen::Vector4d& moved, const Eigen::Matrix4d& covariance_m2) {
  const Square<N> position = covariance_m2.topLeftCorner<N, N>();
  const Eigen::Matrix<double, N, 1> by = moved.head<N>();
  return by.dot(position.ldlt().solve(by));
}

template <int N>
void hold_axes(const Eigen::Matrix3d& least_m2, Eigen::Matrix4d& covariance_m2) {
  const Eigen::LLT<Square<N>> factor(covariance_m2.topLeftCorner<N, N>());
  if (factor.info() != Eigen::Success || !least_m2.allFinite()) return;
  const Square<N> root = factor.matrixL();
  // In units of what is claimed: whatever is larger than one is lacking.
  const Square<N> unclaim = root.inverse();
  const auto axes = axes_of<N>(unclaim * least_m2.topLeftCorner<N, N>() * unclaim.transpose());
  const Square<N> ways = root * axes.eigenvectors();
  covariance_m2.topLeftCorner<N, N>() +=
      ways * (axes.eigenvalues().array() - 1.0).max(0.0).matrix().asDiagonal() * ways.transpose();
}

}  // namespace

void reach(const Eigen::Vector4d& moved, Dims dims, Eigen::Matrix4d& covariance_m2) {
  const double far2 = dims == Dims::two ? sigmas2<2>(moved, covariance_m2) : sigmas2<3>(moved, covariance_m2);
  if (!(far2 > 1.0) || !moved.allFinite()) return;
  covariance_m2 += (1.0 - 1.0 / far2) * moved * moved.transpose();
}

void widen_in_plane(double sigma_m, Eigen::Matrix4d& covariance_m2) {
  const auto axes = axes_of<2>(covariance_m2.topLeftCorner<2, 2>());
  const Eigen::Vector2d lacking_m2 = (sigma_m * sigma_m - axes.eigenvalues().array()).max(0.0).matrix();
  if (!lacking_m2.allFinite()) return;
  covariance_m2.topLeftCorner<2, 2>() +=
      axes.eigenvectors() * lacking_m2.asDiagonal() * axes.eigenvectors().transpose();
}

void hold(const Eigen::Matrix3d& least_m2, Dims dims, Eigen::Matrix4d& covariance_m2) {
  if (dims == Dims::two)
    hold_axes<2>(least_m2, covariance_m2);
  else
    hold_axes<3>(least_m2, covariance_m2);
}

bool much_wider(const Eigen::Matrix4d& now_m2, const Eigen::Matrix4d& before_m2, Dims dims) {
  const int n = dims == Dims::two ? 2 : 3;
  return now_m2.topLeftCorner(n, n).trace() > 1.21 * before_m2.topLeftCorner(n, n).trace();
}

}  // namespace anchord
