#pragma once

#include <Eigen/Core>
#include <span>

#include "core/base/result.hpp"
#include "core/localize/range_block.hpp"
#include "core/localize/solver.hpp"

namespace anchord {

/// Where a descent begins, the bias too: where the last one of nearly the same ranges ended.
struct WarmStart {
  Eigen::Vector3d position_m{0, 0, 0};
  double bias_m{0};
};

/// A round of weights that moves less needs no new sigmas along the lines of sight.
inline constexpr double k_scale_tolerance_m = 1e-9;

/// solve_anchor_gauss_newton() of ranges that are side by side already, for whoever solves them from several
/// places.
Result<AnchorFit> solve_block(RangeBlock& block, const WarmStart& start, const SolverOptions& options,
                              double scale_tolerance_m = k_scale_tolerance_m);

/// descend_to_minimum() likewise.
Result<AnchorMinimum> descend_to_minimum(RangeBlock& block, const Eigen::Vector3d& start,
                                         const SolverOptions& options,
                                         double scale_tolerance_m = k_scale_tolerance_m);

/// The fit of the lowest cost over many starts, whose bias is that of the prior. Descents end at `coarse_m`;
/// only the best of those that settle is then solved to the end. errors: those of the last that failed.
Result<AnchorFit> best_of_starts(RangeBlock& block, std::span<const Eigen::Vector3d> starts,
                                 const SolverOptions& options, double scale_tolerance_m, double coarse_m);

}  // namespace anchord
