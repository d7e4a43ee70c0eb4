#pragma once

#include <span>

#include "core/base/result.hpp"

namespace anchord {

/// RSS of one anchor at one heading of the 360 degree turn (8.3.5).
struct TurnSample {
  double heading_rad{};  ///< of the aircraft, clockwise from north
  double rss_dbm{};
};

struct Bearing {
  double bearing_rad{};  ///< of the anchor, clockwise from north, 0..2 pi
  double sigma_rad{};    ///< 20 degrees (8.3.5) at full confidence, wider below
  double confidence{};   ///< 0..1: how much the best fit stands out from the best one elsewhere
};

/// Bearing from the two-lobe profile of Fig 8.4: RSS is highest at orientations of about 120 and 250 degrees,
/// where orientation = heading - bearing. The profile is slid over the samples (circular correlation with the
/// mean of both removed), so the mean RSS does not matter; the lobes are 130 degrees apart one way and 230
/// the other, which is what makes the answer single.
///
/// samples  any order, at least 8, no gap above 90 degrees
/// errors   too_few_observations, weak_geometry (a gap; or RSS flat within 0.1 dB), invalid_argument (not
/// finite)
Result<Bearing> bearing_from_turn(std::span<const TurnSample> samples);

/// The profile itself, 0..1 over orientation.
double turn_profile(double orientation_rad);

}  // namespace anchord
