#pragma once

#include <algorithm>

#include "core/types/estimate.hpp"

namespace anchord {

/// How well an anchor must be known before a flight calls it done; 95 % bounds. The defaults lie above what
/// the frame and the lever arm alone leave open (FlightOptions::floor_sigma_m: 0.10 m), and below the 0.3 m
/// beyond which no position is to be accepted.
struct AccuracyGoal {
  double h95_m{0.20};
  double v95_m{0.40};
};

inline constexpr const char* k_goal_h95 = "goal_h95_m";
inline constexpr const char* k_goal_v95 = "goal_v95_m";

inline bool is_goal(const Gate& gate) { return gate.name == k_goal_h95 || gate.name == k_goal_v95; }

/// Puts the two gates of the goal last among the estimate's gates, in place of older ones. Where the goal
/// alone is missed, the reason says by how much, what the largest part of the uncertainty is and what would
/// help.
void assess_goal(Estimate& estimate, const AccuracyGoal& goal);

/// The first gate that holds the position back whatever its accuracy; none: nullptr.
inline const Gate* holding_back(const Estimate& estimate) {
  const auto at =
      std::ranges::find_if(estimate.gates, [](const Gate& gate) { return !gate.passed && !is_goal(gate); });
  return at == estimate.gates.end() ? nullptr : &*at;
}

/// Within the goal, and fit to be accepted: verdict ok and every gate passed. False where the goal was never
/// judged, and where the gates were not asked yet, which takes a joint solution of the flight: an accurate
/// answer may be a wrong one.
inline bool reached_goal(const Estimate& estimate) {
  return estimate.acceptable() && std::ranges::count_if(estimate.gates, is_goal) == 2 &&
         estimate.gates.size() > 2;
}

}  // namespace anchord
