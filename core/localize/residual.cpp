#include "core/localize/residual.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

#include "core/localize/range_block.hpp"

namespace anchord {

double default_bend(Loss loss) {
  switch (loss) {
    case Loss::none:
      return 1.0;
    case Loss::huber:
      return 1.345;
    case Loss::cauchy:
      return 2.385;
    case Loss::tukey:
      return 4.685;
  }
  return 1.0;
}

LossValue loss_value(Loss loss, double bend, double e) {
  const double s = e * e;
  const double k2 = bend * bend;
  switch (loss) {
    case Loss::none:
      return {s, 1.0};
    case Loss::huber:
      if (std::abs(e) <= bend) return {s, 1.0};
      return {2.0 * bend * std::abs(e) - k2, bend / std::abs(e)};
    case Loss::cauchy:
      return {k2 * std::log1p(s / k2), 1.0 / (1.0 + s / k2)};
    case Loss::tukey: {
      if (s >= k2) return {k2 / 3.0, 0.0};
      const double inside = 1.0 - s / k2;
      return {k2 / 3.0 * (1.0 - inside * inside * inside), inside * inside};
    }
  }
  return {s, 1.0};
}

double residual_m(const Observation& o, const Unknowns& at, Eigen::Vector4d* derivative) {
  const Eigen::Vector3d difference = at.head<3>() - o.tag_m;
  const double distance_m = difference.norm();
  if (derivative) {
    // On the tag itself there is no direction; any unit vector is a subgradient, up is as good as another.
    derivative->head<3>() =
        distance_m > 1e-9 ? Eigen::Vector3d(difference / distance_m) : Eigen::Vector3d(0, 0, 1);
    (*derivative)[3] = 1.0;
  }
  return o.distance_m - distance_m - at[3];
}

RowScale row_scale(const Observation& o, const Unknowns& at, Weights weights) {
  Eigen::Vector4d derivative;
  residual_m(o, at, &derivative);
  const Eigen::Vector3d u = derivative.head<3>();
  const double sigma_m = std::sqrt(o.sigma_m * o.sigma_m + std::max(u.dot(o.tag_covariance_m2 * u), 0.0));
  return {sigma_m, weights == Weights::as_printed ? std::sqrt(sigma_m) : 1.0};
}

std::vector<RowScale> row_scales(std::span<const Observation> observations, const Unknowns& at,
                                 Weights weights) {
  std::vector<RowScale> scales;
  scales.reserve(observations.size());
  for (const auto& o : observations) scales.push_back(row_scale(o, at, weights));
  return scales;
}

double robust_residual(const Observation& o, const RowScale& scale, const Unknowns& at, Loss loss,
                       double bend, Eigen::Vector4d* derivative) {
  const double e = residual_m(o, at, derivative) / scale.sigma_m;
  const LossValue value = loss_value(loss, bend, e);
  const double size = std::sqrt(value.rho);
  // d sqrt(rho(e^2)) / de = rho' e / sqrt(rho), which tends to 1 at 0.
  const double slope = size > 1e-12 ? value.weight * std::abs(e) / size : 1.0;
  if (derivative) *derivative *= -scale.factor * slope / scale.sigma_m;
  return scale.factor * std::copysign(size, e);
}

std::vector<int> free_unknowns(const SolverOptions& options) {
  std::vector<int> free{0, 1};
  if (options.dims == Dims::three) free.push_back(2);
  if (options.estimate_bias) free.push_back(3);
  return free;
}

Result<void> SolverOptions::check() const {
  if (!(loss_sigmas >= 0) || max_iterations < 1 || !std::isfinite(bias_prior_m) ||
      !(bias_prior_sigma_m > 0)) {
    return make_error(Errc::invalid_argument,
                      "solver options: loss_sigmas >= 0, max_iterations >= 1, bias_prior_sigma_m > 0");
  }
  return boost::outcome_v2::success();
}

Result<void> check_asked(std::size_t n_observations, const Eigen::Vector3d& start,
                         const SolverOptions& options) {
  BOOST_OUTCOME_TRY(options.check());
  // With a prior the bias needs no range of its own; without one there is none here.
  const std::size_t needed = options.dims == Dims::two ? 3 : 4;
  if (n_observations < needed) {
    return make_error(Errc::too_few_observations,
                      std::to_string(n_observations) + " ranges, need " + std::to_string(needed));
  }
  if (!start.allFinite()) return make_error(Errc::invalid_argument, "the start is not finite");
  return boost::outcome_v2::success();
}

Result<void> check_rows(std::span<const Observation> observations) {
  // A number that is not finite stays so in a sum, also times zero; then the rows are asked one by one.
  double nothing = 0, least_sigma_m = 1.0;
  for (const auto& o : observations) {
    nothing += 0.0 * (o.tag_m.sum() + o.distance_m + o.sigma_m + o.tag_covariance_m2.sum());
    least_sigma_m = std::min(least_sigma_m, o.sigma_m);
  }
  if (nothing == 0 && least_sigma_m > 0) return boost::outcome_v2::success();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const auto& o = observations[i];
    if (!o.tag_m.allFinite() || !std::isfinite(o.distance_m) || !std::isfinite(o.sigma_m) ||
        !(o.sigma_m > 0) || !o.tag_covariance_m2.allFinite()) {
      return make_error(Errc::invalid_argument,
                        "observation " + std::to_string(i) + " is not usable: distance " +
                            std::to_string(o.distance_m) + " m, sigma " + std::to_string(o.sigma_m) + " m");
    }
  }
  return boost::outcome_v2::success();
}

Result<void> check_problem(std::span<const Observation> observations, const Eigen::Vector3d& start,
                           const SolverOptions& options) {
  BOOST_OUTCOME_TRY(check_asked(observations.size(), start, options));
  return check_rows(observations);
}

namespace {

/// Sum of W^2 s^2 omega u u^T.
Eigen::Matrix4d noise_of(std::span<const Observation> observations, const Unknowns& at,
                         const SolverOptions& options, double bend) {
  const auto scales = row_scales(observations, at, options.weights);
  Eigen::Matrix4d noise = Eigen::Matrix4d::Zero();
  Eigen::Vector4d u;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const double s_m = scales[i].sigma_m, factor2 = scales[i].factor * scales[i].factor;
    const LossValue value = loss_value(options.loss, bend, residual_m(observations[i], at, &u) / s_m);
    noise += value.weight * factor2 * factor2 / (s_m * s_m) * u * u.transpose();
  }
  return noise;
}

}  // namespace

Result<AnchorFit> finish_fit(RangeBlock& block, const Unknowns& at, const SolverOptions& options) {
  if (!at.allFinite())
    return make_error(Errc::no_convergence, "the solver reached a value that is not finite");
  const double bend = options.loss_sigmas > 0 ? options.loss_sigmas : default_bend(options.loss);
  const auto free = free_unknowns(options);
  const auto size = static_cast<Eigen::Index>(free.size());
  AnchorFit fit;
  fit.position_m = at.head<3>();
  fit.bias_m = at[3];
  block.scale(at, options.weights);
  const RangeNormal sums = block.normal(at, options.loss, bend);
  fit.cost = sums.cost;
  Eigen::Matrix4d normal = sums.matrix;  // sum of W omega u u^T
  Eigen::Matrix4d noise = normal;        // the same with W^2 s^2: what the noise does to the gradient
  if (options.weights == Weights::as_printed) noise = noise_of(block.observations(), at, options, bend);
  fit.residuals_m = block.residuals_m(at);
  if (options.estimate_bias) {
    const double information = 1.0 / (options.bias_prior_sigma_m * options.bias_prior_sigma_m);
    normal(3, 3) += information;
    noise(3, 3) += information;
    const double off = at[3] - options.bias_prior_m;
    fit.cost += 0.5 * information * off * off;
  }
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 4, 4>;  // no heap
  Matrix a(size, size), b(size, size);
  for (Eigen::Index r = 0; r < size; ++r) {
    for (Eigen::Index c = 0; c < size; ++c) {
      const auto row = free[static_cast<std::size_t>(r)];
      const auto col = free[static_cast<std::size_t>(c)];
      a(r, c) = normal(row, col);
      b(r, c) = noise(row, col);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(a);
  // 1e-10: what planning/gdop calls singular; below, the covariance would be rounding noise.
  if (!(eigen.eigenvalues().minCoeff() > 1e-10 * eigen.eigenvalues().maxCoeff())) {
    return make_error(Errc::weak_geometry,
                      "some direction is not measured at all: eigenvalues of the normal matrix " +
                          std::to_string(eigen.eigenvalues().minCoeff()) + " to " +
                          std::to_string(eigen.eigenvalues().maxCoeff()));
  }
  const Matrix inverse = a.inverse();
  const Matrix covariance = options.weights == Weights::as_printed ? Matrix(inverse * b * inverse) : inverse;
  for (Eigen::Index r = 0; r < size; ++r) {
    for (Eigen::Index c = 0; c < size; ++c) {
      const auto row = free[static_cast<std::size_t>(r)];
      const auto col = free[static_cast<std::size_t>(c)];
      if (row < 3 && col < 3) fit.covariance_m2(row, col) = covariance(r, c);
      if (row == 3 && col == 3) fit.bias_sigma_m = std::sqrt(covariance(r, c));
    }
  }
  return fit;
}

}  // namespace anchord
