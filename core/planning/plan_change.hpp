#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/types/plan.hpp"

namespace anchord::planning {

enum class Changed : std::uint8_t {
  added,
  removed,
  moved,    ///< elsewhere or higher; of an area: its corners differ
  altered,  ///< where it was, but its heading, dwell or what is done there differ
};
inline constexpr auto k_changed_words = enum_table<Changed>({{"added", Changed::added},
                                                             {"removed", Changed::removed},
                                                             {"moved", Changed::moved},
                                                             {"altered", Changed::altered}});

enum class AreaKind : std::uint8_t { outline, fence, no_fly };
inline constexpr auto k_area_words = enum_table<AreaKind>(
    {{"outline", AreaKind::outline}, {"fence", AreaKind::fence}, {"no_fly", AreaKind::no_fly}});

struct WaypointChange {
  Changed change{};
  std::optional<std::size_t> before, after;  ///< index in the two lists
  double moved_m{};
};
struct AreaChange {
  AreaKind area{};
  Changed change{};
  std::optional<std::size_t> before, after;  ///< index of a no-fly area
};

struct TargetChange {
  NetworkId anchor{};
  std::optional<double> before_m, after_m;  ///< absent: the target of the settings
};

/// What two revisions of a plan differ in, settings apart.
struct PlanChange {
  std::vector<WaypointChange> waypoints;  ///< in the order of the flight
  std::vector<AreaChange> areas;
  std::vector<NetworkId> anchors_added, anchors_removed;
  std::vector<TargetChange> targets;  ///< of anchors with one of their own, before or after; in order of ids
  /// First waypoint of the plan after that is not one of, or before one of, the first `flown` of the plan
  /// before.
  std::size_t next{};
};

/// Waypoints have no names: they are paired so that as little as possible differs, in their order; further
/// apart than 15 m one is removed and another added. 1000 against 1000 waypoints: some 20 ms.
PlanChange plan_change(const Plan& before, const Plan& after, std::size_t flown);

bool same_waypoint(const PlanWaypoint& a, const PlanWaypoint& b);

}  // namespace anchord::planning
