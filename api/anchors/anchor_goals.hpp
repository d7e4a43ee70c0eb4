#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "core/base/ids.hpp"
#include "core/localize/accuracy_goal.hpp"

namespace anchord::api {

/// The limits by which "accurate enough" is assessed and shown, of every anchor of a calibration, a
/// publication or a running flight: the rule of core/localize/accuracy_goal with what this server knows.
struct AnchorGoals {
  AccuracyGoal site{};  ///< settings goal.h95_m and goal.v95_m
  /// What the plan that a mission was flown by wants; absent: no server flies.
  std::function<PlanTargets(const MissionId&)> targets{};

  /// Of these flights, the newest first: read once for all anchors of an answer.
  std::vector<PlanTargets> flown(std::vector<MissionId> missions) const;
  AnchorGoal of(NetworkId anchor, const std::vector<PlanTargets>& flown) const {
    return anchor_goal(anchor, flown, site);
  }
};

/// {source, words, reached, limits: [gate]}: reached means accurate enough, whatever the verdict.
nlohmann::ordered_json anchor_goal_json(const AnchorGoal& goal, const Estimate& estimate);
bool within(const AnchorGoal& goal, const Estimate& estimate);

}  // namespace anchord::api
