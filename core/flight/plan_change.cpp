// A plan edited in flight: what of it is still to be flown, and why it may not be.
#include "core/flight/plan_change.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/flight/checklist.hpp"
#include "core/planning/flight_time.hpp"
#include "core/planning/route.hpp"
#include "core/procedure/safety.hpp"

namespace anchord::flight {
namespace {

using procedure::Step;

constexpr std::size_t k_most_reasons = 6;

std::string words(const char* format, double a, double b = 0) {
  std::array<char, 200> out{};
  std::snprintf(out.data(), out.size(), format, a, b);
  return out.data();
}

/// The plan with the areas that the autopilot keeps out of.
Plan closed_by(Plan plan, const std::optional<DroneFence>& keeps) {
  if (!keeps) return plan;
  for (const auto& area : keeps->outside) {
    if (area != plan.outline && std::ranges::find(plan.no_fly, area) == plan.no_fly.end())
      plan.no_fly.push_back(area);
  }
  return plan;
}

Plan still_to_fly(Plan plan, std::size_t from) {
  const auto n = static_cast<std::ptrdiff_t>(std::min(from, plan.waypoints.size()));
  plan.waypoints.erase(plan.waypoints.begin(), plan.waypoints.begin() + n);
  return plan;
}

planning::FlightTime time_of(const Plan& plan) {
  const auto local = planning::local_plan(plan);
  return local ? planning::flight_time(local.value(), plan) : planning::FlightTime{};
}

/// How many of the plan's own waypoints are behind the aircraft, or being worked at.
std::size_t flown_of_plan(const ChangeBasis& now) {
  const std::size_t flown = now.waypoint + (now.next_is_current ? 0 : 1);
  return now.kept && now.kept->extra && flown > 0 ? flown - 1 : std::min(flown, now.plan.waypoints.size());
}

void refuse_by_step(Step step, std::vector<std::string>& out) {
  if (step == Step::ready || step == Step::done) out.emplace_back("this mission is not being flown");
  if (step == Step::take_off) out.emplace_back("the aircraft is taking off: wait until it is in the air");
  if (step == Step::landing) out.emplace_back("the aircraft is landing: the plan can no longer be changed");
}

/// Heights of a plan are above its origin: that cannot move under an aircraft.
void refuse_by_origin(const ChangeBasis& now, const Plan& wanted, std::vector<std::string>& out) {
  const auto& flown = now.frame.origin();
  const auto& o = wanted.origin;
  const bool same = o ? now.own_origin && o->lat_deg == flown.lat_deg && o->lon_deg == flown.lon_deg &&
                            o->height_m == flown.height_m
                      : !now.own_origin;
  if (!same) out.emplace_back("the origin differs: heights are measured from it; land to change it");
}

void refuse_by_fence(const ChangeBasis& now, const Plan& wanted, std::vector<std::string>& out) {
  if (now.autopilot_keeps && now.autopilot_keeps->inside != wanted.fence)
    out.emplace_back(
        "the autopilot keeps the fence that was uploaded before take-off: draw a no-fly area to close a part "
        "of it, or land to change the fence");
}

void refuse_by_check(const Plan& rest, std::size_t next, std::vector<std::string>& out) {
  const auto checked = planning::check_plan(rest);
  if (!checked) {
    out.push_back(checked.error().message);
    return;
  }
  for (const auto& issue : checked.value().issues) {
    if (issue.severity != planning::Severity::error || issue.code == "no_waypoints") continue;
    if (out.size() >= k_most_reasons) return;
    const bool counted = next > 0 && issue.pointer.starts_with("/waypoints");
    out.push_back(
        counted ? issue.text + words(" (counted from the next waypoint, %.0f)", static_cast<double>(next + 1))
                : issue.text);
  }
}

void note(const ChangeBasis& now, const Plan& wanted, PlanProposal& out) {
  const std::size_t flown = flown_of_plan(now);
  const bool behind = std::ranges::any_of(out.change.waypoints, [&](const planning::WaypointChange& c) {
    return c.after ? *c.after < out.change.next : *c.before < flown;
  });
  if (behind)
    out.notes.push_back(
        out.change.next == 0
            ? "Waypoints that have already been flown are removed: this changes nothing in flight"
            : words("Changes up to waypoint %.0f are not flown: the aircraft has passed it",
                    static_cast<double>(out.change.next)));
  if (now.plan.settings.speed_mps != wanted.settings.speed_mps)
    out.notes.push_back(words("The speed stays %.1f m/s until the landing", now.plan.settings.speed_mps));
  const bool fewer_areas = std::ranges::any_of(out.change.areas, [](const planning::AreaChange& a) {
    return a.area != planning::AreaKind::fence && a.change != planning::Changed::added;
  });
  if (now.autopilot_keeps && fewer_areas)
    out.notes.emplace_back(
        "The outline and the no-fly areas that were uploaded to the autopilot before take-off stay closed "
        "until the landing");
  const auto& limit = wanted.settings.max_flight_s;
  if (limit && now.flown_s + out.after_s.expected_s > *limit)
    out.notes.push_back(
        words("The flight is expected to take %.0f s; at the limit of %.0f s it returns unfinished",
              now.flown_s + out.after_s.expected_s, *limit));
  const double need =
      battery_need(out.after_s.expected_s, wanted.settings.endurance_s, wanted.settings.min_battery);
  if (now.battery && *now.battery < need)
    out.notes.push_back(
        words("The battery is at %.0f %%, the rest of the flight needs %.0f %% with 30 %% reserve: it may "
              "return unfinished",
              100 * *now.battery, 100 * need));
}

}  // namespace

std::vector<PlanWaypoint> flown_waypoints(const Plan& plan, const std::optional<KeptPlace>& kept) {
  auto out = plan.waypoints;
  if (!kept) return out;
  if (kept->extra)
    out.insert(out.begin(), kept->waypoint);
  else if (kept->at < out.size())
    out[kept->at] = kept->waypoint;
  return out;
}

Result<procedure::FlightSetup> setup_of(const Plan& plan, const std::optional<KeptPlace>& kept,
                                        const std::optional<DroneFence>& autopilot_keeps,
                                        const Eigen::Vector3d& home_m) {
  Plan flown = closed_by(plan, autopilot_keeps);
  flown.waypoints = flown_waypoints(plan, kept);
  return procedure::flight_setup(flown, home_m);
}

std::vector<std::string> refuse_from_here(const PlanProposal& proposal,
                                          const std::optional<Eigen::Vector3d>& position_m) {
  std::vector<std::string> out;
  const auto& setup = proposal.setup.value();
  if (!position_m) return {"the aircraft's position is not known: wait for a position"};
  const auto& bounds = setup.limits.bounds;
  if (auto why = procedure::refuse_standing(setup.limits, *position_m,
                                            "the aircraft would be at a position that is not allowed:"))
    return {*std::move(why)};
  Eigen::Vector3d above = setup.limits.home_m;
  above.z() = std::clamp(above.z() + setup.settings.take_off_m, setup.settings.min_height_m,
                         setup.settings.max_height_m);
  if (!planning::route(bounds, *position_m, above))
    out.emplace_back(
        "the way home would be blocked: there is no route from the aircraft to its take-off point");
  const auto& waypoints = setup.settings.waypoints;
  const auto next = proposal.next;
  if (next < waypoints.size() && !planning::route(bounds, *position_m, waypoints[next].point_m))
    out.push_back(words("there is no route from the aircraft to the next waypoint, %.0f",
                        static_cast<double>(proposal.change.next + 1)));
  return out;
}

PlanProposal propose_change(const ChangeBasis& now, const Plan& wanted) {
  PlanProposal out;
  out.plan = wanted;
  out.plan.origin = now.frame.origin();
  out.plan.settings.speed_mps = now.plan.settings.speed_mps;
  refuse_by_step(now.step, out.refused);
  refuse_by_origin(now, wanted, out.refused);
  refuse_by_fence(now, wanted, out.refused);
  const std::size_t flown = flown_of_plan(now);
  out.change = planning::plan_change(now.plan, wanted, flown);
  const std::size_t next = out.change.next;
  const Plan rest = still_to_fly(out.plan, next);
  out.before_s = time_of(still_to_fly(now.plan, flown));
  out.after_s = time_of(rest);
  refuse_by_check(closed_by(rest, now.autopilot_keeps), next, out.refused);
  note(now, wanted, out);
  if (now.next_is_current) {
    out.waypoint = next;
    if (rest.waypoints.empty()) {
      out.refused.emplace_back("no waypoint is left to fly: command Return to end the flight");
      return out;
    }
  } else {
    const auto flies = flown_waypoints(now.plan, now.kept);
    if (flies.empty()) return out;
    const auto& here = flies[std::min(now.waypoint, flies.size() - 1)];
    out.waypoint = next == 0 ? 0 : next - 1;
    if (next == 0 || !planning::same_waypoint(out.plan.waypoints[next - 1], here))
      out.kept = KeptPlace{here, out.waypoint, next == 0};
  }
  auto setup = setup_of(out.plan, out.kept, now.autopilot_keeps, now.home_m);
  if (!setup) {
    out.refused.push_back(setup.error().message);
    return out;
  }
  out.setup = std::move(setup).value();
  out.setup->decides_apart = now.decides_apart;
  out.next = now.next_is_current ? out.waypoint : out.waypoint + 1;
  for (auto& why : refuse_from_here(out, now.position_m)) out.refused.push_back(std::move(why));
  return out;
}

}  // namespace anchord::flight
