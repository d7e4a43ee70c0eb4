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

/// Puts the two gates of the goal last among the estimate's gates, in place of older ones.
inline void assess_goal(Estimate& estimate, const AccuracyGoal& goal) {
  std::erase_if(estimate.gates,
                [](const Gate& gate) { return gate.name == k_goal_h95 || gate.name == k_goal_v95; });
  const auto add = [&](const char* name, double value, double limit) {
    Gate gate;
    gate.name = name;
    gate.limit = limit;
    if (estimate.best) gate.value = value;
    gate.passed = estimate.best && value <= limit;
    if (!estimate.best) gate.why = "there is no position yet";
    estimate.gates.push_back(std::move(gate));
  };
  add(k_goal_h95, estimate.h95_m, goal.h95_m);
  add(k_goal_v95, estimate.v95_m, goal.v95_m);
}

/// Verdict ok and both bounds within the goal; false where the goal was never judged.
inline bool reached_goal(const Estimate& estimate) {
  if (estimate.verdict != Verdict::ok || !estimate.best) return false;
  return std::count_if(estimate.gates.begin(), estimate.gates.end(), [](const Gate& gate) {
           return gate.passed && (gate.name == k_goal_h95 || gate.name == k_goal_v95);
         }) == 2;
}

}  // namespace anchord
