#include "core/localize/kit_prior.hpp"

#include <Eigen/Dense>
#include <cmath>

namespace anchord {
namespace {

double square(double v) { return v * v; }

/// How far the kit's values wander from flight to flight (estimated from repeated flights of one kit).
Eigen::Matrix4d wander() {
  return Eigen::Vector4d(square(0.03), square(0.01), square(0.02), square(0.01)).asDiagonal();
}

Eigen::Matrix4d base_information(const FlightOptions& options, double bias_sigma_m) {
  return Eigen::Vector4d(1.0 / square(bias_sigma_m), 1.0 / square(options.curve_prior_m),
                         1.0 / square(options.lag_prior_s), 1.0 / square(options.lever_prior_m))
      .asDiagonal();
}

struct Sum {
  Eigen::Matrix4d information{Eigen::Matrix4d::Zero()};
  Eigen::Vector4d information_mean{Eigen::Vector4d::Zero()};
};

}  // namespace

ProfileFactor profile_factor(const JointFit& fit, const SharedPrior& prior, const std::string& flight) {
  const Eigen::Matrix4d& s = fit.normal.reduced;
  // At the optimum the gradient of likelihood and prior cancel: S phi_f = (S + P) phi - P mu.
  const Eigen::Vector4d eta = (s + prior.information) * fit.state.shared - prior.information * prior.mean;
  const Eigen::Matrix4d wander_information = wander().inverse();
  const Eigen::Matrix4d gain = Eigen::Matrix4d::Identity() - s * (s + wander_information).inverse();
  ProfileFactor factor;
  factor.flight = flight;
  factor.information = gain * s;
  factor.information = 0.5 * (factor.information + factor.information.transpose()).eval();
  factor.information_mean = gain * eta;
  return factor;
}

SharedPrior wide_prior(const FlightOptions& options) {
  SharedPrior prior;
  prior.information = base_information(options, options.bias_prior_m);
  if (options.fixed_bias_m) {
    prior.mean[k_shared_bias] = *options.fixed_bias_m;
    prior.information(k_shared_bias, k_shared_bias) = 1.0 / square(1e-4);
  }
  return prior;
}

BiasGate bias_gate(std::span<const ProfileFactor> all, const FlightOptions& options) {
  Sum sum;
  sum.information = base_information(options, options.bias_prior_m);
  for (const auto& factor : all) {
    sum.information += factor.information;
    sum.information_mean += factor.information_mean;
  }
  const Eigen::Matrix4d covariance = sum.information.inverse();
  const Eigen::Vector4d mean = covariance * sum.information_mean;
  BiasGate gate;
  gate.bias_m = mean[k_shared_bias];
  gate.sigma_m = std::sqrt(covariance(k_shared_bias, k_shared_bias));
  gate.z = std::abs(gate.bias_m) / gate.sigma_m;
  gate.calibrated = gate.z < options.bias_gate_z;
  gate.known = !gate.calibrated || gate.sigma_m <= options.bias_known_sigma_m;
  gate.prior_sigma_m = !gate.calibrated ? options.bias_prior_m
                       : gate.known     ? options.calibrated_bias_prior_m
                                        : options.unknown_bias_prior_m;
  return gate;
}

SharedPrior profile_prior(std::span<const ProfileFactor> others, const BiasGate& gate,
                          const FlightOptions& options) {
  if (options.fixed_bias_m) return wide_prior(options);
  Sum sum;
  sum.information = base_information(options, gate.prior_sigma_m);
  for (const auto& factor : others) {
    sum.information += factor.information;
    sum.information_mean += factor.information_mean;
  }
  SharedPrior prior;
  if (others.empty()) {
    prior.information = sum.information;
    return prior;
  }
  const Eigen::Matrix4d covariance = sum.information.inverse();
  prior.mean = covariance * sum.information_mean;
  prior.information = (covariance + wander()).inverse();
  return prior;
}

Eigen::Vector4d prior_sigmas(const SharedPrior& prior) {
  return prior.information.inverse().diagonal().cwiseSqrt();
}

}  // namespace anchord
