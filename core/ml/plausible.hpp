#pragma once

#include <cstdint>
#include <string_view>

/// What a range of a radio and its bias can be at all: one table for training rows, the gate and the live
/// path.
namespace anchord::ml {

/// No radio of this family answers from farther: a longer "range" is of another unit.
inline constexpr double k_reach_m = 150;
/// An antenna delay left at zero is 154 m, more than the reach; nothing else comes near.
inline constexpr double k_most_bias_m = 100;
/// A reflection in a building is metres late. What is more moves anchors out of their hall.
inline constexpr double k_most_correction_m = 10;
/// Short ranges may be late by more than their own length.
inline constexpr double k_always_plausible_m = 2;
/// Ranges in nanoseconds are 3.3 times too long, in feet too.
inline constexpr double k_most_factor = 2;

/// Measured and true range are of one unit: at most k_always_plausible_m apart, or less than a factor of two
/// and k_most_bias_m; and in the radio's reach.
bool plausible_range(double range_m, double bias_m);
/// The same of a correction that is to be applied: at most k_most_correction_m.
bool plausible_correction(double range_m, double bias_m);

/// Why a correction is not applied.
enum class Withheld : std::uint8_t {
  no,
  far_features,  ///< a feature lies more than k_far_sd standard deviations from the training rows
  unseen_bias,   ///< it is beyond every bias of the training rows
  implausible,   ///< plausible_correction()
};
inline constexpr double k_far_sd = 10;
/// In words, after "the correction is withheld: "; empty for `no`.
std::string_view why_withheld(Withheld why);

}  // namespace anchord::ml
