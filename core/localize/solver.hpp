#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/observation.hpp"
#include "core/localize/solver_options.hpp"

namespace anchord {

/// Settings of one anchor's solve.
struct SolverOptions {
  Dims dims{Dims::three};
  Method method{Method::levenberg_marquardt};
  Weights weights{Weights::inverse_variance};
  Loss loss{Loss::none};
  double loss_sigmas{
      0};  ///< where the loss bends; 0: 1.345 huber, 2.385 cauchy, 4.685 tukey (95 % efficiency)
  bool estimate_bias{false};  ///< one constant added to all ranges of the anchor
  double bias_prior_m{0};
  double bias_prior_sigma_m{0.5};
  double step_tolerance_m{1e-10};  ///< a step below it ends the search (Gauss-Newton)
  int max_iterations{100};         ///< per round of weights; a run that wants more is not converging
  Result<void> check() const;
};

/// Answer of one solve.
struct AnchorFit {
  Eigen::Vector3d position_m{0, 0, 0};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};  ///< z row and column 0 in 2D
  double bias_m{0};
  std::optional<double> bias_sigma_m;
  std::vector<double> residuals_m;  ///< range - predicted, input order
  double cost{};                    ///< half the sum of rho
  int iterations{};
};

/// Position of one anchor from ranges taken at known tag positions, by Ceres.
///
/// Minimizes  sum_i W_i s_i^2 rho((r_i - |a - q_i| - b)^2 / s_i^2)  over a (and b), s_i^2 = sigma_i^2 + u^T
/// C_i u: the RTK covariance projected on the line of sight u. W_i = 1/s_i^2, or 1/s_i as eq 7.11 prints it.
/// One analytic cost block holds all ranges. Source: eq 7.8-7.27.
///
/// observations  finite, sigma_m > 0, n >= 3 (2D) or 4 (3D), one more with a bias
/// start         ENU or local metres; in 2D its z is the anchor's height
/// errors        invalid_argument, too_few_observations, weak_geometry (covariance does not exist),
/// no_convergence accuracy      agrees with solve_anchor_gauss_newton to 1e-6 m over 1000 seeded cases
/// (solver_test.cpp) threads       pure; one thread per solve
Result<AnchorFit> solve_anchor(std::span<const Observation> observations, const Eigen::Vector3d& start,
                               const SolverOptions& options = {});

/// Where a descent from one start ended.
struct AnchorMinimum {
  Eigen::Vector3d position_m{0, 0, 0};
  double bias_m{0};
  double cost{};  ///< half the sum of rho, prior of the bias included
  int iterations{};
  bool settled{false};  ///< false: out of iterations; place and cost are those of the last step
};
/// Descent of solve_anchor_gauss_newton without covariance, for the search among many starts: what did not
/// settle, or leaves a direction unmeasured, still has a place and a cost to compete with.
/// errors  invalid_argument, too_few_observations; no_convergence only where the numbers stopped being finite
Result<AnchorMinimum> descend_to_minimum(std::span<const Observation> observations,
                                         const Eigen::Vector3d& start, const SolverOptions& options = {});

/// The same problem by damped Gauss-Newton (eq 7.26-7.27), with the curvature of the loss near the minimum,
/// on fixed-size Eigen matrices: light enough for the live path, and an independent check of the other.
/// `method` is ignored.
Result<AnchorFit> solve_anchor_gauss_newton(std::span<const Observation> observations,
                                            const Eigen::Vector3d& start, const SolverOptions& options = {});

}  // namespace anchord
