#include "core/localize/weighed_row.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

#include "core/localize/error_model_likelihood.hpp"

namespace anchord {

double row_variance_m2(const JointLine& line, const AnchorBlock& block, double scale_m) {
  return scale_m * scale_m + std::max(line.position_variance_m2 - block.usual_position_variance_m2, 0.0);
}

WeighedRow weighed_row(const JointRow& row, const JointLine& line, const AnchorBlock& block, double scale_m,
                       const FlightOptions& options) {
  if (row.error_model) {
    const auto value = error_model_value(*row.error_model, line.residual_m, line.position_variance_m2);
    if (!(value.information_per_m2 > 0)) return {};
    return {value.information_per_m2 / block.kappa, value.score_per_m / value.information_per_m2};
  }
  const double variance_m2 = row_variance_m2(line, block, scale_m);
  const double robust = robust_weight(line.residual_m / std::sqrt(variance_m2), options);
  return {robust / (variance_m2 * block.kappa), line.residual_m};
}

Eigen::Matrix4d add_anchor_priors(NetworkId id, const JointState::Anchor& anchor,
                                  const FlightOptions& options, Eigen::Matrix4d own,
                                  Eigen::Vector4d& gradient) {
  const double delay_information = 1.0 / (options.delay_prior_m * options.delay_prior_m);
  own(3, 3) += delay_information;
  gradient[3] -= delay_information * anchor.delay_m;
  const PriorNormal place =
      prior_normal(priors_of(id, options), options.outline_m, options.outline_sigma_m, anchor.position_m);
  own.topLeftCorner<3, 3>() += place.information;
  gradient.head<3>() += place.gradient;
  if (options.dims == Dims::two) {
    own.row(2).setZero();
    own.col(2).setZero();
    own(2, 2) = 1.0;
    gradient[2] = 0;
  }
  // A direction no range sees, as in build_normal.
  own.topLeftCorner<3, 3>().diagonal().array() +=
      1e-6 * own.topLeftCorner<3, 3>().diagonal().maxCoeff() + 1e-12;
  return own.ldlt().solve(Eigen::Matrix4d::Identity());
}

}  // namespace anchord
