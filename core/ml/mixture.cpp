#include "core/ml/mixture.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord::ml {
namespace {

constexpr double k_uniform = 0.01;  // share of ranges nothing explains
constexpr double k_uniform_width_m = 10.0;

double normal_cdf(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

}  // namespace

double erfcx(double x) {
  if (x < 5) return std::exp(x * x) * std::erfc(x);
  // Continued fraction, backwards; 30 levels are exact to double precision from 5 on.
  double tail = 0;
  for (int k = 30; k >= 1; --k) tail = 0.5 * k / (x + tail);
  return 1 / (std::sqrt(std::numbers::pi) * (x + tail));
}

double emg_log_density(double e, double mean, double sigma, double tau) {
  const double z = (e - mean) / sigma;
  const double u = (sigma / tau - z) / std::numbers::sqrt2;
  if (u > -5) return -std::log(2 * tau) - 0.5 * z * z + std::log(erfcx(u));
  return -std::log(tau) + 0.5 * sigma * sigma / (tau * tau) - (e - mean) / tau + std::log(0.5 * std::erfc(u));
}

double emg_cdf(double e, double mean, double sigma, double tau) {
  const double z = (e - mean) / sigma;
  const double cdf = normal_cdf(z) - tau * std::exp(emg_log_density(e, mean, sigma, tau));
  return std::clamp(cdf, 0.0, 1.0);
}

double BiasMixture::shared_m(std::span<const double> features) const {
  if (shared.kappa == 0 || shared.features.empty()) return shared.centre_m;
  double g = shared.offset_m;
  for (std::size_t i = 0; i < shared.features.size(); ++i) {
    const double x = std::clamp(features[shared.features[i]], shared.low[i], shared.high[i]);
    g += shared.weight[i] * (x - shared.mean[i]) / shared.sd[i];
  }
  return shared.centre_m + shared.kappa * (g - shared.centre_m);
}

double BiasMixture::correction_m(const BiasDensity& density) const {
  return gain * density.quantile(quantile);
}

double BiasMixture::tau_m(std::span<const double> features) const {
  double log_value = log_tau;
  for (const auto& term : tail)
    log_value += term.weight * std::clamp((features[term.feature] - term.mean) / term.sd, -2.0, 2.0);
  return std::exp(std::clamp(log_value, -6.0, 3.0));  // 2.5 mm .. 20 m
}

double BiasDensity::log_density(double bias_m) const {
  const double e = bias_m - shared_m;
  const double z = (e - m0_m) / s0_m;
  const double los = std::exp(-0.5 * z * z) / (s0_m * std::sqrt(2 * std::numbers::pi));
  const double nlos = std::exp(emg_log_density(e, m1_m, s1_m, tau_m));
  const double uniform =
      std::abs(e) <= 0.5 * k_uniform_width_m ? 1 / k_uniform_width_m : 1e-3 / k_uniform_width_m;
  return std::log((1 - k_uniform) * (p_los * los + (1 - p_los) * nlos) + k_uniform * uniform);
}

double BiasDensity::cdf(double bias_m) const {
  const double e = bias_m - shared_m;
  const double uniform = std::clamp(0.5 + e / k_uniform_width_m, 0.0, 1.0);
  return (1 - k_uniform) *
             (p_los * normal_cdf((e - m0_m) / s0_m) + (1 - p_los) * emg_cdf(e, m1_m, s1_m, tau_m)) +
         k_uniform * uniform;
}

double BiasDensity::quantile(double q) const {
  double low = shared_m - 30, high = shared_m + 60;
  while (high - low > 1e-4) {
    const double middle = 0.5 * (low + high);
    (cdf(middle) < q ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double BiasDensity::mean_m() const { return shared_m + p_los * m0_m + (1 - p_los) * (m1_m + tau_m); }

double BiasDensity::sigma_m() const {
  const double los = m0_m, nlos = m1_m + tau_m;
  const double mean = p_los * los + (1 - p_los) * nlos;
  const double second =
      p_los * (s0_m * s0_m + los * los) + (1 - p_los) * (s1_m * s1_m + tau_m * tau_m + nlos * nlos);
  return std::sqrt(std::max(1e-6, second - mean * mean));
}

BiasDensity density_of(const BiasMixture& m, double p_los, std::span<const double> features) {
  return {p_los, m.shared_m(features), m.m0_m, m.s0_m, m.m1_m, m.s1_m, m.tau_m(features)};
}

}  // namespace anchord::ml
