#pragma once

#include "core/types/range_error_model.hpp"

namespace anchord {

/// What one range error says under a model's error model, for a Gauss-Newton round.
struct ErrorModelValue {
  double p_los{};  ///< after the error is seen
  double density_per_m{};
  double score_per_m{};         ///< -d log density / d e
  double curvature_per_m2{};    ///< for the step: Gaussian of each part, by how likely the part is
  double information_per_m2{};  ///< to be claimed: score squared, whose mean is the Fisher information
};

/// The one-sided mixture of RangeErrorModel at e = range - distance, both parts widened by what the tag's
/// place is uncertain along the line of sight. A late range pulls little, an early one fully: blocked paths
/// are late. error_m finite; variance_m2 >= 0. Total: never zero density, for a share of k_stray is anything
/// at all.
ErrorModelValue error_model_value(const RangeErrorModel& error_model, double error_m, double variance_m2);

/// Mean of the error before it is seen.
double expected_error_m(const RangeErrorModel& error_model);

}  // namespace anchord
