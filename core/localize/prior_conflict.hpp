#pragma once

#include <string>

#include "core/localize/side_priors.hpp"
#include "core/localize/solver_options.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Bearing and height priors that the position found contradicts by more than three sigmas, with both values,
/// in words; empty where there are none. The ranges count there: prior_rows() lets such a prior weigh by its
/// logarithm.
/// place_m  of the anchor, in the frame of the priors; without a height where heights are held (Dims::two)
std::string prior_conflict(const AnchorPriors& priors, const Eigen::Vector3d& place_m, Dims dims);

/// Appends it to the reason of an estimate that has a position.
void name_prior_conflict(const AnchorPriors& priors, Dims dims, Estimate& estimate);

}  // namespace anchord
