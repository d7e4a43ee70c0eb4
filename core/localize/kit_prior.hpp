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

/// Is the kit's bias calibrated away, or does it have one? In a small volume the antenna pattern alone
/// imitates a common bias of 0.1 m, while true uncalibrated kits stand out: z decides, on all flights
/// including the one solved, and where it is near its limit the answer lies between.
struct BiasGate {
  double bias_m{}, sigma_m{};  ///< of the kit, with every doubt about it
  double z{};                  ///< bias over sigma, as the ranges alone have them
  bool calibrated{};           ///< z below the gate
  bool known{};                ///< not calibrated, or known well enough to say that it is
  double prior_sigma_m{1.0};   ///< of the bias about zero: continuous in z and in what the ranges know
  /// Variance of the bias beyond what that prior leaves: kits have biases of every size, and however many
  /// flights speak, a pattern may imitate what they see.
  double doubt_m2{};
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
