#pragma once

#include <cstddef>
#include <span>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Sigma of a height that was not given and is held at that of the track: a storey.
inline constexpr double k_unstated_height_sigma_m = 3.0;

/// Name of the gate; its value is the sigma of the given height.
inline constexpr const char* k_held_height_gate = "held_height";

/// In the plane (Dims::two) heights are given, not measured: what the sigma of the held height adds to the
/// covariance of an anchor, E, N, U in m^2. The anchor's place goes along by -N^-1 sum w a a_z per metre of
/// height, N being its own normal equations by (e, n, delay) and a the row's derivatives, the shared held
/// (heights wrong by different amounts move no bias): a tag far above or below sees a wrong height as a wrong
/// place.
Eigen::Matrix3d held_height_m2(const FlightRows& flight, const JointFit& fit, std::size_t index,
                               const FlightOptions& options);

/// Not passed, and without a value, where no height was given; else where its sigma is beyond 0.5 m: the
/// place then moves by more than the line above says.
Gate held_height_gate(const FlightOptions& options);

/// Flights that hold one height share its error, which no mean of them makes smaller: the covariance of
/// their mean, its height as uncertain as it was given and its place along with it.
/// estimates  that the mean is of; without the gate nothing is held
void hold_height_sigma(std::span<const Estimate* const> estimates, Eigen::Matrix3d& covariance_m2);

}  // namespace anchord
