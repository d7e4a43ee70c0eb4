#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace anchord {

/// Order of the shared unknowns in every vector and matrix: b (m), c (m per e-fold), tau (s), l_z (m).
inline constexpr int k_shared_bias = 0;
inline constexpr int k_shared_curve = 1;
inline constexpr int k_shared_lag = 2;
inline constexpr int k_shared_lever = 3;
/// Then, known to one flight alone and no part of a profile: the lever arm's forward and left part (m).
inline constexpr int k_shared_forward = 4;
inline constexpr int k_shared_left = 5;
/// Then, of one flight alone too: what each antenna's vertical arm differs from l_z (m), in the order of
/// FlightRows::antennas. A flight with one antenna uses none, one with more than four lets the rest share
/// l_z.
inline constexpr int k_shared_antennas = 6;
inline constexpr int k_most_antennas = 4;
inline constexpr int k_shared_size = k_shared_antennas + k_most_antennas;
/// How many of them a profile carries.
inline constexpr int k_profile_size = 4;
using SharedVector = Eigen::Matrix<double, k_shared_size, 1>;
using SharedMatrix = Eigen::Matrix<double, k_shared_size, k_shared_size>;

/// What one flight says about the shared unknowns, flight-to-flight wander already allowed for.
struct ProfileFactor {
  std::string flight;
  std::string digest{};  ///< of the flight's content (flight_digest); empty in profiles of old
  Eigen::Matrix4d information{Eigen::Matrix4d::Zero()};
  Eigen::Vector4d information_mean{Eigen::Vector4d::Zero()};  ///< information * mean
};

/// Calibration of one kit (tag + receiver + aircraft), carried from flight to flight without truth.
struct KitProfile {
  std::string kit;
  std::vector<ProfileFactor> factors;
};

}  // namespace anchord
