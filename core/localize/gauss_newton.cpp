#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/localize/residual.hpp"
#include "core/localize/solver.hpp"

namespace anchord {
namespace {

struct Normal {
  Eigen::Matrix4d matrix{Eigen::Matrix4d::Zero()};  ///< eq 7.26 with the robust weight on W: never indefinite
  Eigen::Matrix4d curvature{Eigen::Matrix4d::Zero()};  ///< of the cost itself, far out perhaps indefinite
  Eigen::Vector4d gradient{Eigen::Vector4d::Zero()};
  double cost{};
};

/// Slope of psi(e) = weight(e) e: what the weights' own change adds to the curvature.
double psi_slope(Loss loss, double bend, double e) {
  const double s = e * e / (bend * bend);
  switch (loss) {
    case Loss::none:
      return 1.0;
    case Loss::huber:
      return std::abs(e) <= bend ? 1.0 : 0.0;
    case Loss::cauchy:
      return (1.0 - s) / ((1.0 + s) * (1.0 + s));
    case Loss::tukey:
      return s < 1.0 ? (1.0 - s) * (1.0 - 5.0 * s) : 0.0;
  }
  return 1.0;
}

/// Normal equations of one step. Held unknowns get a unit diagonal.
Normal build(std::span<const Observation> observations, const std::vector<RowScale>& scales,
             const Unknowns& at, const SolverOptions& options, double bend) {
  Normal n;
  Eigen::Vector4d u;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const double e_m = residual_m(observations[i], at, &u);
    const RowScale& scale = scales[i];
    const double e = e_m / scale.sigma_m;
    const LossValue value = loss_value(options.loss, bend, e);
    const double m2 = scale.factor * scale.factor;
    const double information = m2 / (scale.sigma_m * scale.sigma_m);
    const double weight = value.weight * information;
    n.matrix.noalias() += weight * u * u.transpose();
    n.gradient += weight * e_m * u;
    n.cost += 0.5 * m2 * value.rho;
    n.curvature.noalias() += psi_slope(options.loss, bend, e) * information * u * u.transpose();
    // The sphere round the tag bends: d2 |a - q| = (I - u u^T) / |a - q|.
    const double distance_m = (at.head<3>() - observations[i].tag_m).norm();
    if (distance_m > 1e-3) {
      const Eigen::Vector3d way = u.head<3>();
      n.curvature.topLeftCorner<3, 3>() -=
          weight * e_m / distance_m * (Eigen::Matrix3d::Identity() - way * way.transpose());
    }
  }
  if (options.estimate_bias) {
    const double information = 1.0 / (options.bias_prior_sigma_m * options.bias_prior_sigma_m);
    const double off = options.bias_prior_m - at[3];
    n.matrix(3, 3) += information;
    n.curvature(3, 3) += information;
    n.gradient[3] += information * off;
    n.cost += 0.5 * information * off * off;
  }
  const auto hold = [&n](int i) {
    for (Eigen::Matrix4d* m : {&n.matrix, &n.curvature}) {
      m->row(i).setZero();
      m->col(i).setZero();
      (*m)(i, i) = 1.0;
    }
    n.gradient[i] = 0.0;
  };
  if (options.dims == Dims::two) hold(2);
  if (!options.estimate_bias) hold(3);
  return n;
}

struct Descent {
  bool settled{false};
  int iterations{0};
};

/// Levenberg-Marquardt to the nearest minimum. Newton's curvature where it is positive definite, for the
/// reweighted matrix alone approaches a robust minimum so slowly that hundreds of steps do not end; that
/// matrix elsewhere. Damping by the gain ratio (Nielsen 1999), scaled by the diagonal (Marquardt).
Descent descend(std::span<const Observation> observations, const std::vector<RowScale>& scales, Unknowns& at,
                const SolverOptions& options, double bend) {
  Descent descent;
  Normal here = build(observations, scales, at, options, bend);
  double damping = 1e-3, growth = 2.0;
  while (descent.iterations < options.max_iterations && !descent.settled) {
    ++descent.iterations;
    const Eigen::Vector4d scaling =
        here.matrix.diagonal().cwiseMax(1e-12 * here.matrix.diagonal().maxCoeff() + 1e-300);
    const Eigen::Matrix4d damper = (damping * scaling).asDiagonal();
    const Eigen::Matrix4d* model = &here.curvature;
    Eigen::LLT<Eigen::Matrix4d> factor(here.curvature + damper);
    if (factor.info() != Eigen::Success ||
        Eigen::LLT<Eigen::Matrix4d>(here.curvature).info() != Eigen::Success) {
      model = &here.matrix;
      factor.compute(here.matrix + damper);
    }
    const Eigen::Vector4d step = factor.solve(here.gradient);
    if (factor.info() != Eigen::Success || !step.allFinite()) {
      damping = std::max(damping, 1e-9) * growth;
      growth *= 2.0;
      continue;
    }
    const Unknowns next = at + step;
    Normal there = build(observations, scales, next, options, bend);
    const double promised = step.dot(here.gradient) - 0.5 * step.dot(*model * step);
    const double gained = here.cost - there.cost;
    const bool small = step.norm() < options.step_tolerance_m;
    // Rounding of the cost must not refuse the last steps.
    const double rounding = 1e-14 * here.cost + 1e-300;
    if (gained >= -rounding) {
      const double ratio = promised > rounding ? gained / promised : 1.0;
      const double cube = std::pow(2.0 * ratio - 1.0, 3);
      damping *= ratio > 0.9 ? 0.1 : std::clamp(1.0 - cube, 1.0 / 3.0, 2.0);
      if (damping < 1e-12) damping = 0.0;
      growth = 2.0;
      at = next;
      here = there;
    } else {
      damping = std::max(damping, 1e-9) * growth;
      growth *= 2.0;
    }
    descent.settled = small;
  }
  return descent;
}

}  // namespace

Result<AnchorMinimum> descend_to_minimum(std::span<const Observation> observations,
                                         const Eigen::Vector3d& start, const SolverOptions& options) {
  BOOST_OUTCOME_TRY(check_problem(observations, start, options));
  const double bend = options.loss_sigmas > 0 ? options.loss_sigmas : default_bend(options.loss);
  Unknowns at;
  at << start, options.estimate_bias ? options.bias_prior_m : 0.0;
  AnchorMinimum minimum;
  for (int round = 0; round < 20; ++round) {
    const Unknowns before = at;
    const auto scales = row_scales(observations, at, options.weights);
    const Descent descent = descend(observations, scales, at, options, bend);
    minimum.iterations += descent.iterations;
    minimum.settled = descent.settled;
    if (!descent.settled || (at - before).norm() < 1e-9) break;
  }
  if (!at.allFinite()) return make_error(Errc::no_convergence, "the solver left the finite numbers");
  minimum.position_m = at.head<3>();
  minimum.bias_m = at[3];
  minimum.cost = build(observations, row_scales(observations, at, options.weights), at, options, bend).cost;
  return minimum;
}

Result<AnchorFit> solve_anchor_gauss_newton(std::span<const Observation> observations,
                                            const Eigen::Vector3d& start, const SolverOptions& options) {
  BOOST_OUTCOME_TRY(const AnchorMinimum minimum, descend_to_minimum(observations, start, options));
  if (!minimum.settled) {
    return make_error(Errc::no_convergence,
                      "not settled after " + std::to_string(minimum.iterations) + " Gauss-Newton steps");
  }
  Unknowns at;
  at << minimum.position_m, minimum.bias_m;
  BOOST_OUTCOME_TRY(auto fit, finish_fit(observations, at, options));
  fit.iterations = minimum.iterations;
  return fit;
}

}  // namespace anchord
