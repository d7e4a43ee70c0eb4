#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/observation.hpp"
#include "core/localize/solver.hpp"

namespace anchord {

class RangeBlock;

/// Robust loss of a residual in sigmas: cost, and the weight d rho / d s that multiplies its square.
struct LossValue {
  double rho{};
  double weight{};
};
LossValue loss_value(Loss loss, double bend_sigmas, double residual_sigmas);
/// The bend that keeps 95 % efficiency on Gaussian data (Holland and Welsch 1977).
double default_bend(Loss loss);

/// Unknowns x, y, z, bias; what is held is left out of the step.
using Unknowns = Eigen::Vector4d;

/// sigma_i with the tag covariance along the line of sight, and the factor m_i = sqrt(W_i) sigma_i.
struct RowScale {
  double sigma_m{};
  double factor{};
};
RowScale row_scale(const Observation& o, const Unknowns& at, Weights weights);
std::vector<RowScale> row_scales(std::span<const Observation> observations, const Unknowns& at,
                                 Weights weights);

/// Residual i in metres and its derivative by the unknowns (of the prediction: d(|a - q| + b)).
double residual_m(const Observation& o, const Unknowns& at, Eigen::Vector4d* derivative);

/// Whitened robust residual m_i sqrt(rho(e/s)) with sign of e, and its derivative: squares sum to twice the
/// cost.
double robust_residual(const Observation& o, const RowScale& scale, const Unknowns& at, Loss loss,
                       double bend, Eigen::Vector4d* derivative);

/// Checks shared by both solvers: of all rows, and of what is asked of so many of them.
Result<void> check_rows(std::span<const Observation> observations);
Result<void> check_asked(std::size_t n_observations, const Eigen::Vector3d& start,
                         const SolverOptions& options);
Result<void> check_problem(std::span<const Observation> observations, const Eigen::Vector3d& start,
                           const SolverOptions& options);
/// Covariance, residuals and cost at the optimum; weak_geometry when the normal matrix is singular.
Result<AnchorFit> finish_fit(RangeBlock& block, const Unknowns& at, const SolverOptions& options);
/// Indices of the unknowns that move.
std::vector<int> free_unknowns(const SolverOptions& options);

}  // namespace anchord
