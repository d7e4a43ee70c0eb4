#include "core/localize/error_model_likelihood.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord {
namespace {

constexpr double k_stray = 1e-3;          // per metre: a range that fits neither part is nobody's
constexpr double k_least_sigma_m = 1e-3;  // a part of no width would claim infinite information

double normal_density(double z, double sigma) {
  return std::exp(-0.5 * z * z) / (sigma * std::sqrt(2 * std::numbers::pi));
}

/// exp(x^2) erfc(x) without overflow; past 8 its asymptote, to 1e-4.
double scaled_erfc(double x) {
  if (x < 8) return std::exp(x * x) * std::erfc(x);
  return 1.0 / (x * std::sqrt(std::numbers::pi)) * (1.0 - 0.5 / (x * x));
}

/// Gaussian plus exponential delay: exp(-z^2/2) scaled_erfc(y) / 2 tau.
double delayed_density(double z, double sigma, double tau) {
  const double y = (sigma / tau - z) / std::numbers::sqrt2;
  if (y < -5)  // far out in the tail the product above is 0 times infinity
    return std::exp(0.5 * sigma * sigma / (tau * tau) - z * sigma / tau) / tau;
  return 0.5 / tau * std::exp(-0.5 * z * z) * scaled_erfc(y);
}

}  // namespace

ErrorModelValue error_model_value(const RangeErrorModel& error_model, double error_m, double variance_m2) {
  const double p = std::clamp(error_model.p_los, 0.0, 1.0);
  const double los_m = std::sqrt(std::max(error_model.los_sigma_m, k_least_sigma_m) *
                                     std::max(error_model.los_sigma_m, k_least_sigma_m) +
                                 variance_m2);
  const double nlos_m = std::sqrt(std::max(error_model.nlos_sigma_m, k_least_sigma_m) *
                                      std::max(error_model.nlos_sigma_m, k_least_sigma_m) +
                                  variance_m2);
  const double tau_m = std::max(error_model.nlos_tail_m, 0.01);
  const double z_los = (error_m - error_model.los_bias_m) / los_m;
  const double z_nlos = (error_m - error_model.nlos_bias_m) / nlos_m;
  const double los = p * normal_density(z_los, los_m);
  const double delayed = (1 - p) * delayed_density(z_nlos, nlos_m, tau_m);
  // g' = (N - g) / tau, for g is N smoothed by the exponential.
  const double delayed_slope = ((1 - p) * normal_density(z_nlos, nlos_m) - delayed) / tau_m;
  const double density = los + delayed + k_stray;
  ErrorModelValue value;
  value.p_los = los / density;
  value.density_per_m = density;
  value.score_per_m = (los * z_los / los_m - delayed_slope) / density;
  value.curvature_per_m2 =
      value.p_los / (los_m * los_m) + delayed / density / (nlos_m * nlos_m + tau_m * tau_m);
  // Where line of sight is certain the information is known, not to be estimated from one error.
  value.information_per_m2 = p > 0.999 ? 1.0 / (los_m * los_m) : value.score_per_m * value.score_per_m;
  return value;
}

double expected_error_m(const RangeErrorModel& error_model) {
  const double p = std::clamp(error_model.p_los, 0.0, 1.0);
  return p * error_model.los_bias_m +
         (1 - p) * (error_model.nlos_bias_m + std::max(error_model.nlos_tail_m, 0.01));
}

}  // namespace anchord
