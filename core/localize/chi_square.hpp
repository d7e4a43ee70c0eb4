#pragma once

#include <cmath>
#include <numbers>

#include "core/localize/gates.hpp"

namespace anchord {

/// Limit of chi-square at GateLimits::probability with three degrees of freedom, two in the plane.
inline double chi2_limit(bool plane, const GateLimits& limits) {
  return plane ? -2.0 * std::log(1.0 - limits.probability) : chi2_quantile(limits.probability, 3);
}

/// Chance of so much or more, with as many degrees of freedom; closed forms.
inline double chi2_tail(double chi2, bool plane) {
  if (plane) return std::exp(-0.5 * chi2);
  return std::erfc(std::sqrt(0.5 * chi2)) + std::sqrt(2.0 * chi2 / std::numbers::pi) * std::exp(-0.5 * chi2);
}

}  // namespace anchord
