#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// How well an anchor must be known before it counts as done, where no flown plan says so; 95 % bounds. The
/// defaults lie above what the frame and the lever arm alone leave open (FlightOptions::floor_sigma_m:
/// 0.10 m), and below the 0.3 m beyond which no position is to be accepted.
struct AccuracyGoal {
  double h95_m{0.20};
  double v95_m{0.40};
  bool operator==(const AccuracyGoal&) const = default;
};

/// What the plan of a flight wants of its anchors: sigma of the position (position_sigma_m).
struct PlanTargets {
  std::optional<double> sigma_m{};          ///< of every anchor that has none of its own
  std::map<NetworkId, double> of_anchor{};  ///< of those that have one
  bool operator==(const PlanTargets&) const = default;
};

/// Where the limits of an anchor come from, the first that there is.
enum class GoalSource : std::uint8_t { anchor_target, plan_target, site, standard };
inline constexpr auto k_goal_source_words =
    enum_table<GoalSource>({{"anchor_target", GoalSource::anchor_target},
                            {"plan_target", GoalSource::plan_target},
                            {"site", GoalSource::site},
                            {"default", GoalSource::standard}});

/// The limits that one anchor is held against wherever an accuracy is assessed: in flight, in its
/// calibration, in the report, in review and where it is published.
struct AnchorGoal {
  GoalSource source{GoalSource::standard};
  std::optional<double> sigma_m{};  ///< of a target, and then the only limit
  AccuracyGoal bounds{};            ///< else
  bool operator==(const AnchorGoal&) const = default;
};

/// `flown`: of the flights that measured it, the newest first. A target of the anchor's own in any of them
/// comes before the target of a plan. `site`: settings goal.h95_m and goal.v95_m.
AnchorGoal anchor_goal(NetworkId anchor, std::span<const PlanTargets> flown, const AccuracyGoal& site);

/// Which goal it is, with its limits: "target of the anchor in the flown plan, sigma of the position 3 m".
std::string goal_words(const AnchorGoal& goal);

/// Sigma of the position: the root of the trace of its covariance, metres; nothing without a position.
std::optional<double> position_sigma_m(const Estimate& estimate);

inline constexpr const char* k_goal_h95 = "goal_h95_m";
inline constexpr const char* k_goal_v95 = "goal_v95_m";
inline constexpr const char* k_goal_sigma = "target_sigma_m";

inline bool is_goal(const Gate& gate) {
  return gate.name == k_goal_h95 || gate.name == k_goal_v95 || gate.name == k_goal_sigma;
}

/// The estimate against its goal, one gate a limit.
std::vector<Gate> goal_gates(const Estimate& estimate, const AnchorGoal& goal);
/// Puts them last among the estimate's gates, in place of older ones. Where the goal alone is missed, the
/// reason says by how much, what the largest part of the uncertainty is and what would help.
void assess_goal(Estimate& estimate, const AnchorGoal& goal);

/// The first gate that holds the position back whatever its accuracy; none: nullptr.
const Gate* holding_back(const Estimate& estimate);

/// Within the goal, and fit to be accepted: verdict ok and every gate passed. False where the goal was never
/// judged, and where the gates were not asked yet, which takes a joint solution of the flight: an accurate
/// answer may be a wrong one.
bool reached_goal(const Estimate& estimate);

}  // namespace anchord
