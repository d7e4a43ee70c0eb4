#pragma once

#include "core/ml/learn.hpp"

namespace anchord::ml {

/// Metres of mean error that a metre of harm done to the worst place is worth; less harm than the second is
/// none.
inline constexpr double k_harm_price = 0.5, k_harmless_m = 0.02;

/// Identification alone: candidates, pick, refit, calibration.
Result<Learned> learn_class(const Dataset& data, const LearnOptions& options,
                            const std::vector<std::size_t>& fold);

/// Classifier and bias mixture together: the mixture is fitted on out-of-fold probabilities, and how much of
/// its correction is applied (quantile and gain) is what helped on held-out places without harming one.
Result<Learned> learn_bias_mixture(const Dataset& data, const LearnOptions& options,
                                   const std::vector<std::size_t>& fold);

}  // namespace anchord::ml
