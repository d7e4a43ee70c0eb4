#include "core/localize/kit_prior.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace anchord {
namespace {

/// What the pattern of an antenna can look like: no flight alone can tell such a bias from it, whatever its
/// residuals claim. In a small volume flights of one kit came to biases 0.2 m apart; where a flight knows its
/// bias better, by at most twice its sigma (1.8 seen against the other flights of the kit).
constexpr double k_imitated_bias_m = 0.15;

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

/// What the vertical arm of one antenna differs from that of the aircraft's others. Wider, four antennas
/// whose flights hardly tell them apart made anchors worse (viral: 0.1214 m between them against 0.12).
constexpr double k_antenna_spread_m = 0.05;

constexpr int k_flight_size = k_shared_size - k_profile_size;  // unknowns of one flight alone

/// Nothing but what is held or known of this flight's own: the arm's forward and left part, and what the
/// vertical arm of each antenna differs from the common one.
SharedPrior across_prior(const FlightOptions& options) {
  SharedPrior prior;
  const double sigma_m = options.lever_across_prior_m > 0 ? options.lever_across_prior_m : 1e-6;
  prior.information(k_shared_forward, k_shared_forward) = 1.0 / square(sigma_m);
  prior.information(k_shared_left, k_shared_left) = 1.0 / square(sigma_m);
  for (int i = k_shared_antennas; i < k_shared_size; ++i)
    prior.information(i, i) = 1.0 / square(k_antenna_spread_m);
  return prior;
}

/// Two hypotheses, even odds before: the kit is calibrated, or its bias is anything of half a metre. The
/// Bayes factor of what all factors say decides how much of the second remains.
double doubt_m2(const BiasGate& gate, const FlightOptions& options) {
  const double own2 = square(gate.sigma_m), seen2 = square(gate.bias_m);
  const double calibrated2 = own2 + square(options.calibrated_bias_prior_m), other2 = own2 + square(0.5);
  const double odds =
      std::sqrt(calibrated2 / other2) * std::exp(0.5 * seen2 * (1 / calibrated2 - 1 / other2));
  return odds / (1.0 + odds) * (seen2 + own2);
}

struct Sum {
  Eigen::Matrix4d information{Eigen::Matrix4d::Zero()};
  Eigen::Vector4d information_mean{Eigen::Vector4d::Zero()};
};

}  // namespace

ProfileFactor profile_factor(const JointFit& fit, const SharedPrior& prior, const std::string& flight) {
  // The rest of the arms belongs to this flight: marginalised with its prior, what the kit shares without.
  SharedMatrix own_prior = SharedMatrix::Zero();
  own_prior.bottomRightCorner<k_flight_size, k_flight_size>() =
      prior.information.bottomRightCorner<k_flight_size, k_flight_size>();
  // At the optimum the gradient of likelihood and prior cancel: S phi_f = (S + P) phi - P mu.
  const SharedMatrix& likelihood = fit.normal.reduced;
  const SharedVector eta_all = (likelihood + prior.information) * fit.state.shared -
                               prior.information * prior.mean + own_prior * prior.mean;
  const SharedMatrix m = likelihood + own_prior;
  const Eigen::Matrix<double, 4, k_flight_size> gain_across =
      m.topRightCorner<4, k_flight_size>() * m.bottomRightCorner<k_flight_size, k_flight_size>().inverse();
  const Eigen::Matrix4d s = m.topLeftCorner<4, 4>() - gain_across * m.bottomLeftCorner<k_flight_size, 4>();
  const Eigen::Vector4d eta = eta_all.head<4>() - gain_across * eta_all.tail<k_flight_size>();
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
  SharedPrior prior = across_prior(options);
  prior.information.topLeftCorner<4, 4>() = base_information(options, options.bias_prior_m);
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
  if (gate.calibrated && gate.known) gate.doubt_m2 = doubt_m2(gate, options);
  if (gate.calibrated && gate.known && all.size() == 1)
    gate.doubt_m2 = std::max(gate.doubt_m2, square(std::min(k_imitated_bias_m, 2.0 * gate.sigma_m)));
  return gate;
}

void add_doubt(JointFit& fit, const SharedPrior& prior, const BiasGate& gate) {
  if (!(gate.doubt_m2 > 0)) return;
  // Were the mean of the prior moved, the shared unknowns would follow by `shared`, each anchor by `own`.
  const SharedVector shared = fit.shared_covariance * prior.information.col(k_shared_bias);
  for (std::size_t i = 0; i < fit.anchor_covariance.size(); ++i) {
    const AnchorBlock& block = fit.normal.anchors[i];
    const Eigen::Vector4d own = -block.own_inverse * (block.shared * shared);
    if (own.allFinite()) fit.anchor_covariance[i] += gate.doubt_m2 * own * own.transpose();
  }
  fit.shared_covariance += gate.doubt_m2 * shared * shared.transpose();
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
  SharedPrior prior = across_prior(options);
  if (others.empty()) {
    prior.information.topLeftCorner<4, 4>() = sum.information;
    return prior;
  }
  const Eigen::Matrix4d covariance = sum.information.inverse();
  prior.mean.head<4>() = covariance * sum.information_mean;
  prior.information.topLeftCorner<4, 4>() = (covariance + wander()).inverse();
  return prior;
}

SharedVector prior_sigmas(const SharedPrior& prior) {
  return prior.information.inverse().diagonal().cwiseSqrt();
}

}  // namespace anchord
