#include "core/localize/solver.hpp"

#include <ceres/ceres.h>

#include "core/localize/range_block.hpp"
#include "core/localize/residual.hpp"

namespace anchord {
namespace {

/// All ranges of one anchor in one block: one virtual call per iteration instead of one per range.
class AllRanges final : public ceres::CostFunction {
 public:
  AllRanges(std::span<const Observation> observations, std::vector<RowScale> scales,
            const SolverOptions& options, double bend)
      : observations_(observations), scales_(std::move(scales)), options_(options), bend_(bend) {
    mutable_parameter_block_sizes()->push_back(4);
    set_num_residuals(static_cast<int>(observations.size()) + (options.estimate_bias ? 1 : 0));
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Unknowns> at(parameters[0]);
    double* jacobian = jacobians ? jacobians[0] : nullptr;
    Eigen::Vector4d row;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
      residuals[i] =
          robust_residual(observations_[i], scales_[i], at, options_.loss, bend_, jacobian ? &row : nullptr);
      if (jacobian) Eigen::Map<Eigen::Vector4d>(jacobian + 4 * i) = row;
    }
    if (options_.estimate_bias) {
      const std::size_t i = observations_.size();
      residuals[i] = (at[3] - options_.bias_prior_m) / options_.bias_prior_sigma_m;
      if (jacobian) {
        Eigen::Map<Eigen::Vector4d>(jacobian + 4 * i) << 0, 0, 0, 1.0 / options_.bias_prior_sigma_m;
      }
    }
    return true;
  }

 private:
  std::span<const Observation> observations_;
  std::vector<RowScale> scales_;
  SolverOptions options_;
  double bend_;
};

ceres::Solver::Options ceres_options(const SolverOptions& options) {
  ceres::Solver::Options ceres;
  ceres.linear_solver_type = ceres::DENSE_QR;
  ceres.max_num_iterations = options.max_iterations;
  ceres.function_tolerance = 1e-16;  // the step decides: 1e-6 m agreement between solvers needs a tight end
  ceres.gradient_tolerance = 1e-14;
  ceres.parameter_tolerance = 1e-12;
  ceres.num_threads = 1;
  ceres.logging_type = ceres::SILENT;
  switch (options.method) {
    case Method::levenberg_marquardt:
      break;
    case Method::dogleg:
      ceres.trust_region_strategy_type = ceres::DOGLEG;
      break;
    case Method::gauss_newton:
      // A trust region without a border: eq 7.27's step, taken unless it raises the cost.
      ceres.initial_trust_region_radius = 1e16;
      ceres.max_trust_region_radius = 1e32;
      break;
  }
  return ceres;
}

}  // namespace

Result<AnchorFit> solve_anchor(std::span<const Observation> observations, const Eigen::Vector3d& start,
                               const SolverOptions& options) {
  BOOST_OUTCOME_TRY(check_problem(observations, start, options));
  const double bend = options.loss_sigmas > 0 ? options.loss_sigmas : default_bend(options.loss);
  Unknowns at;
  at << start, options.estimate_bias ? options.bias_prior_m : 0.0;
  std::vector<int> held;
  if (options.dims == Dims::two) held.push_back(2);
  if (!options.estimate_bias) held.push_back(3);
  int iterations = 0;
  // The line of sight, and with it the projected variance, follows the anchor: solve, weigh again, until it
  // stays.
  for (int round = 0; round < 20; ++round) {
    const Unknowns before = at;
    ceres::Problem problem;
    problem.AddParameterBlock(at.data(), 4);
    if (!held.empty()) problem.SetManifold(at.data(), new ceres::SubsetManifold(4, held));
    problem.AddResidualBlock(
        new AllRanges(observations, row_scales(observations, at, options.weights), options, bend), nullptr,
        at.data());
    ceres::Solver::Summary summary;
    ceres::Solve(ceres_options(options), &problem, &summary);
    iterations += static_cast<int>(summary.iterations.size());
    if (!summary.IsSolutionUsable() || !at.allFinite()) {
      return make_error(Errc::no_convergence, summary.message);
    }
    if ((at - before).norm() < 1e-9) break;
  }
  RangeBlock block(observations);
  BOOST_OUTCOME_TRY(auto fit, finish_fit(block, at, options));
  fit.iterations = iterations;
  return fit;
}

}  // namespace anchord
