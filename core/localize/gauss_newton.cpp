#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/localize/range_block.hpp"
#include "core/localize/residual.hpp"
#include "core/localize/solver.hpp"
#include "core/localize/warm_solve.hpp"

namespace anchord {
namespace {

/// Normal equations of one step. Held unknowns get a unit diagonal.
RangeNormal build(const RangeBlock& block, const Unknowns& at, const SolverOptions& options, double bend) {
  RangeNormal n = block.normal(at, options.loss, bend);
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
Descent descend(const RangeBlock& block, Unknowns& at, const SolverOptions& options, double bend) {
  Descent descent;
  RangeNormal here = build(block, at, options, bend);
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
    RangeNormal there = build(block, next, options, bend);
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

/// Descends from a place; no cost yet. The block is left with the scales of the round before the last.
Result<AnchorMinimum> descend_from(RangeBlock& block, const WarmStart& start, const SolverOptions& options,
                                   double scale_tolerance_m) {
  BOOST_OUTCOME_TRY(check_asked(block.observations().size(), start.position_m, options));
  if (!block.checked()) {
    BOOST_OUTCOME_TRY(check_rows(block.observations()));
    block.set_checked();
  }
  const double bend = options.loss_sigmas > 0 ? options.loss_sigmas : default_bend(options.loss);
  Unknowns at;
  at << start.position_m, options.estimate_bias ? start.bias_m : 0.0;
  AnchorMinimum minimum;
  for (int round = 0; round < 20; ++round) {
    const Unknowns before = at;
    block.scale(at, options.weights);
    const Descent descent = descend(block, at, options, bend);
    minimum.iterations += descent.iterations;
    minimum.settled = descent.settled;
    if (!descent.settled || block.one_scale() || (at - before).norm() < scale_tolerance_m) break;
  }
  if (!at.allFinite())
    return make_error(Errc::no_convergence, "the solver reached a value that is not finite");
  minimum.position_m = at.head<3>();
  minimum.bias_m = at[3];
  return minimum;
}

}  // namespace

Result<AnchorMinimum> descend_to_minimum(RangeBlock& block, const Eigen::Vector3d& start,
                                         const SolverOptions& options, double scale_tolerance_m) {
  BOOST_OUTCOME_TRY(auto minimum,
                    descend_from(block, {start, options.bias_prior_m}, options, scale_tolerance_m));
  const double bend = options.loss_sigmas > 0 ? options.loss_sigmas : default_bend(options.loss);
  Unknowns at;
  at << minimum.position_m, minimum.bias_m;
  if (!block.one_scale()) block.scale(at, options.weights);
  minimum.cost = build(block, at, options, bend).cost;
  return minimum;
}

Result<AnchorMinimum> descend_to_minimum(std::span<const Observation> observations,
                                         const Eigen::Vector3d& start, const SolverOptions& options) {
  RangeBlock block(observations);
  return descend_to_minimum(block, start, options);
}

Result<AnchorFit> solve_block(RangeBlock& block, const WarmStart& start, const SolverOptions& options,
                              double scale_tolerance_m) {
  BOOST_OUTCOME_TRY(const AnchorMinimum minimum, descend_from(block, start, options, scale_tolerance_m));
  if (!minimum.settled) {
    return make_error(Errc::no_convergence,
                      "not converged after " + std::to_string(minimum.iterations) + " Gauss-Newton steps");
  }
  Unknowns at;
  at << minimum.position_m, minimum.bias_m;
  BOOST_OUTCOME_TRY(auto fit, finish_fit(block, at, options));
  fit.iterations = minimum.iterations;
  return fit;
}

Result<AnchorFit> best_of_starts(RangeBlock& block, std::span<const Eigen::Vector3d> starts,
                                 const SolverOptions& options, double scale_tolerance_m, double coarse_m) {
  SolverOptions coarse = options;
  coarse.step_tolerance_m = coarse_m;
  std::vector<AnchorMinimum> ends;
  Result<AnchorFit> best = make_error(Errc::no_convergence, "no start converged");
  for (const auto& start : starts) {
    auto end = descend_to_minimum(block, start, coarse, coarse_m);
    if (end && end.value().settled) ends.push_back(end.value());
    if (!end) best = end.error();
  }
  std::ranges::stable_sort(ends, {}, &AnchorMinimum::cost);
  for (const auto& end : ends) {
    best = solve_block(block, {end.position_m, end.bias_m}, options, scale_tolerance_m);
    if (best) break;
  }
  return best;
}

Result<AnchorFit> solve_anchor_gauss_newton(std::span<const Observation> observations,
                                            const Eigen::Vector3d& start, const SolverOptions& options) {
  RangeBlock block(observations);
  return solve_block(block, {start, options.bias_prior_m}, options);
}

}  // namespace anchord
