#include "core/localize/kit_prior.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace anchord {
namespace {

/// What the pattern of an antenna looks like in the ranges of a small volume (anchors in one room differed by
/// -0.07 to 0.11 m); where a flight knows its bias better, as much as its own sigma. Flights round the same
/// anchors repeat it, so it does not average out.
constexpr double k_imitated_bias_m = 0.07;

// How softly the kinds of kits part, in z and in the logarithm of sigma. Sharper, a flight more or less would
// move the answer by more than its sigma; softer, kits that stand out by z = 3.8 are drawn to zero.
constexpr double k_softness_z = 0.35;
constexpr double k_softness_log = 0.25;

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

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }

/// Sigma of a Gaussian about zero: that of calibrated kits, of those that have a bias, and between them where
/// nothing tells. Continuous in both, so that no flight more or less turns the answer over.
double prior_sigma_m(double z, double sigma_m, const FlightOptions& options) {
  const double biased = options.bias_gate_z > 0 ? logistic((z - options.bias_gate_z) / k_softness_z) : 1.0;
  const double unknown = logistic(std::log(sigma_m / options.bias_known_sigma_m) / k_softness_log);
  const double calibrated_log =
      std::lerp(std::log(options.calibrated_bias_prior_m), std::log(options.unknown_bias_prior_m), unknown);
  return std::exp(std::lerp(calibrated_log, std::log(options.bias_prior_m), biased));
}

/// Kits whose bias is normal about zero with this variance.
struct KitKind {
  double sigma2{};
  double p{};  ///< given what was seen

  /// How far the mean of this kind follows what was seen with variance s2.
  double gain(double s2) const { return sigma2 / (s2 + sigma2); }
};

/// Biases of every size, none likelier than another before: sigmas doubled from the calibrated on.
std::vector<KitKind> kinds_given(double seen_m, double s2, const FlightOptions& options) {
  std::vector<KitKind> kinds;
  for (double m = options.calibrated_bias_prior_m; m < options.bias_prior_m; m *= 2)
    kinds.push_back({square(m)});
  double sum = 0;
  for (KitKind& kind : kinds) {
    // Against the widest: no exponential overflows.
    const double far = square(seen_m) * (1.0 / (s2 + kind.sigma2) - 1.0 / (s2 + kinds.back().sigma2));
    kind.p = std::exp(-0.5 * far) / std::sqrt(s2 + kind.sigma2);
    sum += kind.p;
  }
  for (KitKind& kind : kinds) kind.p /= sum;
  return kinds;
}

/// What the ranges of all factors say of the bias.
struct Seen {
  double bias_m{}, variance_m2{};  ///< with the wide prior they were weighed with
  double imitated_m2{};            ///< variance of what patterns imitate; flights repeat it
};

/// Mean square error of a mean that follows what was seen by `gain`, over biases of every size.
double mean_square_m2(double seen_m, double s2, double imitated_m2, double gain,
                      const FlightOptions& options) {
  double sum_m2 = 0;
  for (const KitKind& kind : kinds_given(seen_m, s2 + imitated_m2, options)) {
    const double own = kind.gain(s2 + imitated_m2);
    sum_m2 += kind.p * (own * (s2 + imitated_m2) + square(seen_m * (own - gain)));
  }
  return sum_m2;
}

struct Sum {
  Eigen::Matrix4d information{Eigen::Matrix4d::Zero()};
  Eigen::Vector4d information_mean{Eigen::Vector4d::Zero()};
};

Seen seen_by(std::span<const ProfileFactor> all, const FlightOptions& options) {
  Sum sum;
  sum.information = base_information(options, options.bias_prior_m);
  double imitated = 0, told = 0;
  for (const auto& factor : all) {
    const Eigen::Matrix4d alone = base_information(options, options.bias_prior_m) + factor.information;
    const double own2 = alone.inverse()(k_shared_bias, k_shared_bias);
    imitated += std::min(square(k_imitated_bias_m) / own2, 1.0);
    told += 1.0 / own2;
    sum.information += factor.information;
    sum.information_mean += factor.information_mean;
  }
  const Eigen::Matrix4d covariance = sum.information.inverse();
  return {(covariance * sum.information_mean)[k_shared_bias], covariance(k_shared_bias, k_shared_bias),
          told > 0 ? imitated / told : 0.0};
}

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
  const Seen seen = seen_by(all, options);
  BiasGate gate;
  gate.z = std::abs(seen.bias_m) / std::sqrt(seen.variance_m2);
  gate.calibrated = gate.z < options.bias_gate_z;
  gate.prior_sigma_m = prior_sigma_m(gate.z, std::sqrt(seen.variance_m2), options);
  // What the ranges say without the wide prior, and how far a mean with the other prior follows it.
  const double s2 = 1.0 / std::max(1.0 / seen.variance_m2 - 1.0 / square(options.bias_prior_m), 1e-6);
  const double seen_m = seen.bias_m / seen.variance_m2 * s2;
  const double gain = square(gate.prior_sigma_m) / (s2 + square(gate.prior_sigma_m));
  gate.bias_m = gain * seen_m;
  const double error_m2 = mean_square_m2(seen_m, s2, seen.imitated_m2, gain, options);
  gate.sigma_m = std::sqrt(error_m2);
  gate.doubt_m2 = std::max(error_m2 - gain * s2, 0.0);
  gate.known = !gate.calibrated || gate.sigma_m <= options.bias_known_sigma_m;
  return gate;
}

void add_doubt(JointFit& fit, const BiasGate& gate) {
  if (!(gate.doubt_m2 > 0)) return;
  // Were the bias another, the shared unknowns would follow by `shared` per metre, each anchor by `own`.
  const SharedVector shared =
      fit.shared_covariance.col(k_shared_bias) / fit.shared_covariance(k_shared_bias, k_shared_bias);
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
