#include <Eigen/Dense>
#include <cmath>

#include "core/localize/joint_model.hpp"
#include "core/localize/residual.hpp"

namespace anchord {
namespace {

/// Ranges between anchors, r = |x_a - x_b| + d_a + d_b + b_p: their common bias b_p is marginalised, which
/// ties their errors together. Cauchy weights, since a blocked pair stays blocked however often it is asked.
void add_pairs(const FlightRows& flight, const JointState& state, const FlightOptions& options,
               DenseNormal& dense) {
  const auto count = static_cast<Eigen::Index>(flight.pairs.size());
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(count, dense.matrix.cols());
  Eigen::VectorXd residual_m = Eigen::VectorXd::Zero(count);
  Eigen::VectorXd variance_m2(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const PairRow& pair = flight.pairs[static_cast<std::size_t>(k)];
    const auto& a = state.anchors[pair.a];
    const auto& b = state.anchors[pair.b];
    variance_m2[k] = 1e12;
    if (!a.active || !b.active) continue;
    const Eigen::Vector3d between = a.position_m - b.position_m;
    const double distance_m = std::max(between.norm(), 1e-6);
    residual_m[k] = pair.distance_m - distance_m - a.delay_m - b.delay_m;
    const double wide2 = pair.sigma_m * pair.sigma_m + options.pair_bias_prior_m * options.pair_bias_prior_m;
    const double weight = loss_value(Loss::cauchy, 2.385, residual_m[k] / std::sqrt(wide2)).weight;
    variance_m2[k] = pair.sigma_m * pair.sigma_m / weight;
    const auto at_a = 4 * static_cast<Eigen::Index>(pair.a), at_b = 4 * static_cast<Eigen::Index>(pair.b);
    const Eigen::RowVector3d u = (between / distance_m).transpose();
    jacobian.block<1, 3>(k, at_a) = u;
    jacobian.block<1, 3>(k, at_b) = -u;
    jacobian(k, at_a + 3) = jacobian(k, at_b + 3) = 1.0;
    if (options.dims == Dims::two) jacobian(k, at_a + 2) = jacobian(k, at_b + 2) = 0.0;
  }
  Eigen::MatrixXd covariance = variance_m2.asDiagonal();
  covariance.array() += options.pair_bias_prior_m * options.pair_bias_prior_m;
  const Eigen::MatrixXd weighted = covariance.ldlt().solve(jacobian);
  dense.matrix.noalias() += jacobian.transpose() * weighted;
  dense.gradient.noalias() += weighted.transpose() * residual_m;
}

}  // namespace

DenseNormal dense_normal(const FlightRows& flight, const JointState& state, const JointNormal& normal,
                         const SharedPrior& prior, const FlightOptions& options) {
  const auto n = 4 * static_cast<Eigen::Index>(state.anchors.size());
  DenseNormal dense{Eigen::MatrixXd::Zero(n + k_shared_size, n + k_shared_size),
                    Eigen::VectorXd::Zero(n + k_shared_size)};
  dense.matrix.bottomRightCorner<k_shared_size, k_shared_size>() = normal.shared + prior.information;
  dense.gradient.tail<k_shared_size>() =
      normal.shared_gradient + prior.information * (prior.mean - state.shared);
  for (Eigen::Index i = 0; i < n; i += 4) {
    const AnchorBlock& block = normal.anchors[static_cast<std::size_t>(i / 4)];
    dense.matrix.block<4, 4>(i, i) = block.own;
    dense.matrix.block<4, k_shared_size>(i, n) = block.shared;
    dense.matrix.block<k_shared_size, 4>(n, i) = block.shared.transpose();
    dense.gradient.segment<4>(i) = block.gradient;
    // As in the arrow: a direction nothing sees stays where it is. An anchor that takes no part is held.
    const double least = 1e-6 * block.own.topLeftCorner<3, 3>().diagonal().maxCoeff() + 1e-9;
    dense.matrix.diagonal().segment<3>(i).array() += least;
    if (block.n_in_track == 0) dense.matrix.diagonal().segment<4>(i).array() += 1.0;
  }
  add_pairs(flight, state, options, dense);
  return dense;
}

}  // namespace anchord
