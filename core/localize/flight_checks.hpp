#pragma once

#include <optional>
#include <span>

#include "core/localize/joint_model.hpp"
#include "core/localize/kit_profile.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

inline constexpr double k_arm_asked_m = 0.3;  ///< as wide as a wrong entry in a form
inline constexpr double k_arm_z = 4.0;        ///< sigmas of the flight: beyond, the arm is contradicted

/// What the ranges say about the forward and left part of the lever arm if it is not held: an arm declared
/// wrongly moves every anchor, and no residual looks large. One Gauss-Newton step from the solution where
/// that is clear; where it only looks odd, the flight is solved again with the arm free, since the misfit of
/// a wrong arm hides in the residual scale. Nothing where the arm is asked for, or without attitude.
/// returns  a gate (lever_arm) that failed, or nothing.  errors  canceled
Result<std::optional<Gate>> check_lever_arm(const FlightRows& rows, const JointFit& fit,
                                            const SharedPrior& prior, const FlightOptions& options);

/// Does a flight say the same about its kit as the kit's other flights? Bias, curve, lag and offset, each
/// and together, by what both are uncertain with the wander between flights allowed for: another tag, a
/// clock that changed its offset, an antenna that was moved. Gate "profile".
/// alone  factor of the flight solved with the wide prior
Gate check_profile(const ProfileFactor& alone, std::span<const ProfileFactor> others,
                   const FlightOptions& options);

/// Did a part of the track stand off as a whole? The larger part is believed, and beyond max_step_share of
/// the positions a person decides which of the two is true. Gate "track". share  of the good positions, in
/// parts that are off
Gate check_steps(double share, const FlightOptions& options);

}  // namespace anchord
