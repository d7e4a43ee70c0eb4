#pragma once

#include <span>

#include "core/types/estimate.hpp"

namespace anchord {

/// One answer for an anchor that several flights heard, all in the same frame.
///
/// Of the flights whose verdict is ok: the information-weighted mean, x = (sum C_i^-1)^-1 sum C_i^-1 x_i,
/// covariance (sum C_i^-1)^-1, widened by chi2 / dof where the flights disagree by more than chance (that
/// factor above 1). Where they disagree beyond the 0.1 % point of chi2 with 3 (n - 1) degrees of freedom the
/// verdict is `diverged` and the reason says by how much: two flights that contradict each other are no
/// accepted position. So it is where a flight that is `ambiguous` has both its places horizontally elsewhere:
/// an anchor that was moved is not where it was, though its new height is open. Without an ok flight: the
/// answer with the smallest h95_m, verdict and reason kept. Counts add up. estimates: at least one, of one
/// anchor.
Estimate fuse_estimates(std::span<const Estimate> estimates);

}  // namespace anchord
