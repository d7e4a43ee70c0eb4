#include <Eigen/Dense>
#include <cmath>

#include "core/localize/residual.hpp"
#include "core/localize/solver.hpp"

namespace anchord {
namespace {

struct Normal {
  Eigen::Matrix4d matrix{Eigen::Matrix4d::Zero()};
  Eigen::Vector4d gradient{Eigen::Vector4d::Zero()};
  double cost{};
};

/// Iteratively reweighted normal equations, eq 7.26 with the robust weight on W. Held unknowns get a unit
/// diagonal.
Normal build(std::span<const Observation> observations, const std::vector<RowScale>& scales,
             const Unknowns& at, const SolverOptions& options, double bend) {
  Normal n;
  Eigen::Vector4d u;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const double e_m = residual_m(observations[i], at, &u);
    const RowScale& scale = scales[i];
    const LossValue value = loss_value(options.loss, bend, e_m / scale.sigma_m);
    const double m2 = scale.factor * scale.factor;
    const double weight = value.weight * m2 / (scale.sigma_m * scale.sigma_m);
    n.matrix.noalias() += weight * u * u.transpose();
    n.gradient += weight * e_m * u;
    n.cost += 0.5 * m2 * value.rho;
  }
  if (options.estimate_bias) {
    const double information = 1.0 / (options.bias_prior_sigma_m * options.bias_prior_sigma_m);
    const double off = options.bias_prior_m - at[3];
    n.matrix(3, 3) += information;
    n.gradient[3] += information * off;
    n.cost += 0.5 * information * off * off;
  }
  const auto hold = [&n](int i) {
    n.matrix.row(i).setZero();
    n.matrix.col(i).setZero();
    n.matrix(i, i) = 1.0;
    n.gradient[i] = 0.0;
  };
  if (options.dims == Dims::two) hold(2);
  if (!options.estimate_bias) hold(3);
  return n;
}

}  // namespace

Result<AnchorFit> solve_anchor_gauss_newton(std::span<const Observation> observations,
                                            const Eigen::Vector3d& start, const SolverOptions& options) {
  BOOST_OUTCOME_TRY(check_problem(observations, start, options));
  const double bend = options.loss_sigmas > 0 ? options.loss_sigmas : default_bend(options.loss);
  Unknowns at;
  at << start, options.estimate_bias ? options.bias_prior_m : 0.0;
  int iterations = 0;
  for (int round = 0; round < 20; ++round) {
    const Unknowns before = at;
    const auto scales = row_scales(observations, at, options.weights);
    double damping = 0.0;
    Normal here = build(observations, scales, at, options, bend);
    bool settled = false;
    for (int i = 0; i < options.max_iterations && !settled; ++i, ++iterations) {
      Eigen::Matrix4d damped = here.matrix;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::Vector4d step = damped.ldlt().solve(here.gradient);
      if (!step.allFinite()) return make_error(Errc::weak_geometry, "the normal matrix is singular");
      const Unknowns next = at + step;
      Normal there = build(observations, scales, next, options, bend);
      if (there.cost <= here.cost * (1.0 + 1e-14) + 1e-300) {
        settled = step.norm() < options.step_tolerance_m;
        at = next;
        here = there;
        damping = damping < 1e-6 ? 0.0 : damping * 0.1;
      } else {
        settled = step.norm() < options.step_tolerance_m;
        damping = damping == 0.0 ? 1e-4 : damping * 10.0;
      }
    }
    if (!settled) {
      return make_error(Errc::no_convergence,
                        "not settled after " + std::to_string(iterations) + " Gauss-Newton steps");
    }
    if ((at - before).norm() < 1e-9) break;
  }
  BOOST_OUTCOME_TRY(auto fit, finish_fit(observations, at, options));
  fit.iterations = iterations;
  return fit;
}

}  // namespace anchord
