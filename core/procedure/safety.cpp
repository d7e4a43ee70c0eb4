#include "core/procedure/safety.hpp"

#include <cmath>
#include <limits>

#include "core/procedure/sentence.hpp"

namespace anchord::procedure {
namespace {

constexpr double k_other_ground_m =
    10;  ///< a slope, or a roof, between the plan's ground and the place of take-off

/// The rule that a point breaks, in the operator's words and with the numbers.
std::string explain(const planning::Bounds& bounds, planning::Refusal refusal, const Eigen::Vector3d& at_m) {
  using planning::Refusal;
  switch (refusal) {
    case Refusal::outside_fence:
      return at_m.allFinite() && bounds.fence.size() >= 3
                 ? sentence("%.1f m outside the fence",
                            planning::distance_to_edge_m(bounds.fence, at_m.head<2>()))
                 : "outside the fence";
    case Refusal::no_fly: {
      double nearest_m = std::numeric_limits<double>::infinity();
      for (const auto& area : bounds.no_fly) {
        if (planning::contains(area, at_m.head<2>())) return "over the building or inside a no-fly area";
        if (area.size() >= 3)
          nearest_m = std::min(nearest_m, planning::distance_to_edge_m(area, at_m.head<2>()));
      }
      return sentence("%.1f m from the building or a no-fly area, %.1f m required", nearest_m,
                      bounds.keep_out_m);
    }
    case Refusal::near_wall:
      return "too close to a wall";
    case Refusal::too_low:
      return sentence("%.1f m high, the height band begins at %.1f m", at_m.z(),
                      bounds.min_height_m.value_or(0));
    case Refusal::too_high:
      return sentence("%.1f m high, the height band ends at %.1f m", at_m.z(),
                      bounds.max_height_m.value_or(0));
    case Refusal::path_blocked:
      return "the straight line crosses the building, a no-fly area or the fence";
    case Refusal::visited:
    case Refusal::unreachable:
    case Refusal::over_range:
    case Refusal::on_anchor:
      break;  // of the planner's candidates, not of bounds
  }
  return std::string(planning::to_string(refusal));
}

/// The same volume, wider by the tolerance: what a breach is beyond.
planning::Bounds widened(const SafetyLimits& limits) {
  planning::Bounds wide = limits.bounds;
  wide.keep_out_m = std::max(0.0, wide.keep_out_m - limits.tolerance_m);
  wide.min_height_m.reset();  // below the band is where one takes off and lands
  if (wide.max_height_m) *wide.max_height_m += limits.tolerance_m;
  for (auto& wall : wide.walls) wall.keep_out_m = std::max(0.0, wall.keep_out_m - limits.tolerance_m);
  return wide;
}

std::optional<Alarm> breach(const SafetyLimits& limits, const Eigen::Vector3d& at_m) {
  const auto refusal = planning::refuse_point(widened(limits), at_m);
  if (!refusal) return std::nullopt;
  if (*refusal == planning::Refusal::outside_fence) {
    const double out_m = planning::distance_to_edge_m(limits.bounds.fence, at_m.head<2>());
    if (out_m <= limits.tolerance_m && at_m.allFinite()) return std::nullopt;
    return Alarm{Reaction::hold, false, "fence.breach", sentence("%.1f m outside the fence", out_m)};
  }
  if (*refusal == planning::Refusal::too_high) {
    return Alarm{Reaction::hold, false, "fence.breach",
                 sentence("%.1f m high, the height band ends at %.1f m", at_m.z(),
                          limits.bounds.max_height_m.value_or(0))};
  }
  return Alarm{Reaction::hold, false, "fence.breach",
               sentence("nearer than %.1f m to the building or a no-fly area", limits.bounds.keep_out_m)};
}

}  // namespace

std::optional<std::string> refuse_standing(const SafetyLimits& limits, const Eigen::Vector3d& at_m,
                                           std::string_view what) {
  const auto floor_m = limits.bounds.min_height_m;
  if (floor_m && at_m.z() < *floor_m - limits.floor_tolerance_m)
    return std::string(what) + sentence(" %.1f m high, the height band begins at %.1f m", at_m.z(), *floor_m);
  if (!breach(limits, at_m)) return std::nullopt;
  const auto refusal = planning::refuse_point(widened(limits), at_m);
  return std::string(what) + ' ' + explain(limits.bounds, *refusal, at_m);
}

std::optional<Refused> refuse_take_off(const planning::Bounds& bounds, const Eigen::Vector3d& stands_m,
                                       double height_m) {
  // Straight up from where it stands, which must be inside the fence and outside every no-fly area.
  Eigen::Vector3d above = stands_m;
  above.z() = std::max(height_m, bounds.min_height_m.value_or(height_m));
  // The plan's heights are above its ground: who has to climb much further than they go stands on another
  // ground, or its height is wrong.
  const double climb_m = above.z() - stands_m.z();
  if (bounds.max_height_m && climb_m > *bounds.max_height_m + k_other_ground_m)
    return Refused{"too_high",
                   sentence("no take-off from here: %.0f m up to the plan's height band, which ends at %.0f "
                            "m above its ground:",
                            climb_m, *bounds.max_height_m) +
                       sentence(" is the height of the plan's origin right? It is %.0f m above the aircraft",
                                -stands_m.z())};
  const auto refusal = planning::refuse_point(bounds, above);
  if (!refusal) return std::nullopt;
  return Refused{std::string(planning::to_string(*refusal)),
                 "no take-off from here: " + explain(bounds, *refusal, above)};
}

std::optional<Refused> refuse_command(const SafetyLimits& limits,
                                      const std::optional<Eigen::Vector3d>& aircraft_m,
                                      const Command& command) {
  const auto& bounds = limits.bounds;
  if (command.kind == Command::Kind::take_off) {
    const double height = command.point_m.z();
    if (!(height > 0) || (bounds.max_height_m && height > *bounds.max_height_m)) {
      return Refused{"take_off_height", sentence("take-off to %.1f m is outside the height band", height)};
    }
    return aircraft_m ? refuse_take_off(bounds, *aircraft_m, height) : std::nullopt;
  }
  if (command.kind != Command::Kind::go_to) return std::nullopt;
  if (!command.point_m.allFinite() || (command.heading_rad && !std::isfinite(*command.heading_rad))) {
    return Refused{"not_finite", "the position of the target is not a number"};
  }
  if (!aircraft_m || !aircraft_m->allFinite())
    return Refused{"position_unknown", "the aircraft's position is not known"};
  const double jump_m = (command.point_m - *aircraft_m).norm();
  if (jump_m > limits.max_jump_m) {
    return Refused{
        "jump", sentence("the target is %.0f m away, at most %.0f m are allowed", jump_m, limits.max_jump_m)};
  }
  if (const auto refusal = planning::refuse_point(bounds, command.point_m)) {
    return Refused{std::string(planning::to_string(*refusal)),
                   "the target is " + explain(bounds, *refusal, command.point_m)};
  }
  if (const auto refusal = planning::refuse_path(bounds, *aircraft_m, command.point_m)) {
    return Refused{std::string(planning::to_string(*refusal)),
                   "the straight line to the target is not allowed"};
  }
  return std::nullopt;
}

double return_margin(const SafetyLimits& limits, const Eigen::Vector3d& position_m) {
  const double way_m = (position_m - limits.home_m).norm() + std::max(0.0, position_m.z());
  return limits.min_battery + way_m / limits.speed_mps * limits.battery_per_s;
}

std::optional<Alarm> watch(const SafetyLimits& limits, const Situation& now) {
  if (!now.flying) return std::nullopt;
  if (now.battery && *now.battery <= limits.critical_battery) {
    return Alarm{Reaction::land, false, "drone.battery",
                 sentence("battery at %.0f %%: landing here", 100 * *now.battery)};
  }
  if (now.battery_warning >= 2) {
    return Alarm{Reaction::land, false, "drone.battery",
                 "the autopilot reports a critical battery: landing here"};
  }
  if (now.cell_v && *now.cell_v <= limits.critical_cell_v) {
    return Alarm{Reaction::land, false, "drone.battery",
                 sentence("battery at %.2f V per cell: landing here", *now.cell_v)};
  }
  if (now.battery_warning == 1) {
    return Alarm{Reaction::return_home, false, "drone.battery", "the autopilot reports a low battery"};
  }
  if (now.cell_v && *now.cell_v <= limits.low_cell_v) {
    return Alarm{
        Reaction::return_home, false, "drone.battery",
        sentence("battery at %.2f V per cell, at least %.2f V are needed", *now.cell_v, limits.low_cell_v)};
  }
  if (now.battery && now.position_m && *now.battery <= return_margin(limits, *now.position_m)) {
    return Alarm{Reaction::return_home, false, "drone.battery",
                 sentence("battery at %.0f %%, needed to return %.0f %%", 100 * *now.battery,
                          100 * return_margin(limits, *now.position_m))};
  }
  if (now.position_m && now.position_age_s <= limits.position_age_s) {
    const auto floor_m = limits.bounds.min_height_m;
    if (now.floor && floor_m && now.position_m->z() < *floor_m - limits.floor_tolerance_m) {
      return Alarm{Reaction::hold, true, "fence.breach",
                   sentence("%.1f m high, the height band begins at %.1f m", now.position_m->z(), *floor_m)};
    }
    if (auto alarm = breach(limits, *now.position_m)) return alarm;
  }
  if (now.autopilot_silent_s > limits.link_return_s) {
    return Alarm{Reaction::return_home, false, "drone.link",
                 sentence("autopilot silent for %.0f s", now.autopilot_silent_s)};
  }
  if (now.autopilot_silent_s > limits.link_hold_s) {
    return Alarm{Reaction::hold, false, "drone.link",
                 sentence("autopilot silent for %.0f s", now.autopilot_silent_s)};
  }
  if (!now.position_m || now.position_age_s > limits.position_age_s) {
    if (now.position_age_s > limits.rtk_return_s) {
      return Alarm{Reaction::return_home, false, "rtk.lost",
                   sentence("no position for %.0f s", now.position_age_s)};
    }
    return Alarm{Reaction::hold, false, "rtk.lost", sentence("no position for %.1f s", now.position_age_s)};
  }
  if (now.wants_rtk && now.since_good_fix_s > limits.rtk_return_s) {
    return Alarm{Reaction::return_home, false, "rtk.lost",
                 sentence("no RTK for %.0f s", now.since_good_fix_s)};
  }
  if (now.wants_rtk && now.since_good_fix_s > limits.rtk_hold_s) {
    return Alarm{Reaction::hold, false, "rtk.lost", sentence("no RTK for %.1f s", now.since_good_fix_s)};
  }
  if (now.autopilot_m && (*now.autopilot_m - *now.position_m).norm() > limits.disagree_m) {
    return Alarm{
        Reaction::hold, false, "position.disagree",
        sentence("autopilot and rover disagree by %.1f m", (*now.autopilot_m - *now.position_m).norm())};
  }
  if (now.autopilot_m_age_s > limits.lost_hold_s) {
    return Alarm{Reaction::hold, false, "position.disagree",
                 sentence("the autopilot has not known its position for %.0f s", now.autopilot_m_age_s)};
  }
  return std::nullopt;
}

}  // namespace anchord::procedure
