#include "api/flight/plan_change_json.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/planning/plan_json.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using planning::k_changed_words;

/// As people count them.
Ordered number(const std::optional<std::size_t>& index) {
  return index ? Ordered(*index + 1) : Ordered(nullptr);
}

Ordered time_json(const planning::FlightTime& t) {
  return {{"low", t.low_s}, {"expected", t.expected_s}, {"high", t.high_s}};
}

Ordered names(const std::vector<NetworkId>& anchors) {
  auto out = Ordered::array();
  for (const auto id : anchors) out.push_back(to_string(id));
  return out;
}

Ordered targets(const std::vector<planning::TargetChange>& changes) {
  auto out = Ordered::array();
  for (const auto& c : changes)
    out.push_back({{"network_id", to_string(c.anchor)},
                   {"before", or_null(c.before_m)},
                   {"after", or_null(c.after_m)}});
  return out;
}

/// Settings that differ, and what else of the plan is one value.
Ordered settings_changed(const Plan& before, const Plan& after) {
  auto out = Ordered::array();
  const Ordered was = plan_json(before), is = plan_json(after);
  for (const auto& [name, value] : was["settings"].items())
    if (value != is["settings"][name])
      out.push_back({{"name", name}, {"before", value}, {"after", is["settings"][name]}});
  if (before.building_height_m != after.building_height_m)
    out.push_back({{"name", "building_height_m"},
                   {"before", before.building_height_m},
                   {"after", after.building_height_m}});
  return out;
}

}  // namespace

Ordered flown_plan_json(const MissionId& mission, const FlightService::FlownPlan& flown) {
  const bool changed = flown.n_changes > 0;
  return {{"mission", to_string(mission)},
          {"changes", flown.n_changes},
          {"changed_at", changed ? Ordered(to_rfc3339(flown.changed)) : Ordered(nullptr)},
          {"changed_by", changed ? Ordered(flown.changed_by) : Ordered(nullptr)},
          {"saved_revision", flown.saved_revision > 0 ? Ordered(flown.saved_revision) : Ordered(nullptr)},
          {"undo_revision", or_null(flown.former_revision)},
          {"plan", plan_json(flown.plan)}};
}

Ordered plan_difference_json(const MissionId& mission, const FlightService::PlanDifference& difference) {
  const auto& p = difference.proposal;
  auto waypoints = Ordered::array(), areas = Ordered::array();
  for (const auto& w : p.change.waypoints) {
    const bool flown = w.after && *w.after < p.change.next;
    waypoints.push_back({{"change", k_changed_words.word(w.change)},
                         {"before", number(w.before)},
                         {"after", number(w.after)},
                         {"moved_m", w.moved_m},
                         {"passed", flown}});
  }
  for (const auto& a : p.change.areas) {
    areas.push_back({{"area", planning::k_area_words.word(a.area)},
                     {"change", k_changed_words.word(a.change)},
                     {"before", number(a.before)},
                     {"after", number(a.after)}});
  }
  return {{"mission", to_string(mission)},
          {"from_revision", difference.before.version},
          {"to_revision", p.plan.version},
          {"takeable", p.refused.empty()},
          {"refused", p.refused},
          {"notes", p.notes},
          {"next_waypoint", p.change.next + 1},
          {"n_waypoints", p.plan.waypoints.size()},
          {"waypoints", std::move(waypoints)},
          {"areas", std::move(areas)},
          {"anchors_added", names(p.change.anchors_added)},
          {"anchors_removed", names(p.change.anchors_removed)},
          {"anchor_targets", targets(p.change.targets)},
          {"settings", settings_changed(difference.before, p.plan)},
          {"forecast_before_s", time_json(p.before_s)},
          {"forecast_after_s", time_json(p.after_s)}};
}

}  // namespace anchord::api
