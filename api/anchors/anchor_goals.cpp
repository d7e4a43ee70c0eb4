#include "api/anchors/anchor_goals.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/anchors/anchor_json.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

/// Ids of missions are UUIDs of version 7: the newest is the greatest.
std::vector<PlanTargets> AnchorGoals::flown(std::vector<MissionId> missions) const {
  std::vector<PlanTargets> out;
  if (!targets) return out;
  std::ranges::sort(missions, std::greater{});
  for (const auto& mission : missions) out.push_back(targets(mission));
  return out;
}

bool within(const AnchorGoal& goal, const Estimate& estimate) {
  return std::ranges::all_of(goal_gates(estimate, goal), &Gate::passed);
}

Ordered anchor_goal_json(const AnchorGoal& goal, const Estimate& estimate) {
  Ordered limits = Ordered::array();
  for (const auto& gate : goal_gates(estimate, goal)) limits.push_back(gate_json(gate));
  return {{"source", k_goal_source_words.word(goal.source)},
          {"words", goal_words(goal)},
          {"reached", within(goal, estimate)},
          {"limits", std::move(limits)}};
}

}  // namespace anchord::api
