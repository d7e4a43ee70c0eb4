#pragma once

#include <span>

#include "core/localize/flight_options.hpp"
#include "core/localize/joint_model.hpp"
#include "core/localize/kit_profile.hpp"

namespace anchord {

/// What a flight says about the shared unknowns: Schur complement over positions and delays minus its prior,
/// with flight-to-flight wander allowed for.
ProfileFactor profile_factor(const JointFit& fit, const SharedPrior& prior, const std::string& flight);

/// Prior of a kit nobody has flown: FlightOptions' sigmas about zero.
SharedPrior wide_prior(const FlightOptions& options);

/// Is the kit's bias calibrated away, or does it have one? Two kinds of kits are weighed by what all factors
/// say, those of the flight solved included: `calibrated_share` of the kits with a bias of some centimetres,
/// the others with one of some decimetres. The posterior of the two is told by its mean and variance, so that
/// nothing jumps where the one becomes likelier than the other.
struct BiasGate {
  double bias_m{}, sigma_m{};  ///< of the kit, every doubt included
  double z{};                  ///< bias over sigma, as the ranges alone have them
  double p_calibrated{};       ///< probability of the first kind
  bool known{};                ///< sigma within bias_known_sigma_m, or surely of the second kind
  double prior_sigma_m{1.0};   ///< of a Gaussian about zero that leads to the same mean
  /// Variance of the bias beyond that Gaussian's posterior: which kind it is, and what a pattern imitates.
  double doubt_m2{};

  bool calibrated() const { return p_calibrated > 0.5; }
};
BiasGate bias_gate(std::span<const ProfileFactor> all, const FlightOptions& options);

/// Widens the covariances of a fit by the doubt about its bias, along the way everything follows the bias.
void add_doubt(JointFit& fit, const BiasGate& gate);

/// Prior for the next flight: what the gate decided about the bias and the factors of the others, widened by
/// the wander where there are any.
SharedPrior profile_prior(std::span<const ProfileFactor> others, const BiasGate& gate,
                          const FlightOptions& options);

/// One sigma of each shared unknown.
SharedVector prior_sigmas(const SharedPrior& prior);

}  // namespace anchord
