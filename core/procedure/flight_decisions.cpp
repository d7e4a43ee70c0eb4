#include <algorithm>
#include <cmath>
#include <utility>

#include "core/localize/accuracy_goal.hpp"
#include "core/procedure/flight_engine.hpp"
#include "core/procedure/why_not_done.hpp"

namespace anchord::procedure {
namespace {

/// Of an anchor: what was done by one is done by the other.
bool same_aim(const ExitRule& a, const ExitRule& b) {
  return a.target_sigma_m == b.target_sigma_m && a.gdop_root == b.gdop_root &&
         a.min_iterations == b.min_iterations && a.max_iterations == b.max_iterations;
}

}  // namespace

/// Done is not reached: a limit of points, time or battery ends an anchor too.
std::string FlightEngine::outcome(const std::string& which) const {
  std::string without;
  std::size_t n = 0;
  for (const auto& task : state_.anchors) {
    if (!task.done || task.reached || task.accepted) continue;
    ++n;
    without += (without.empty() ? "" : ", ") + to_string(task.id);
  }
  if (n == 0) return "every " + which + " anchor is done";
  return "every " + which + " anchor is done or given up; " + std::to_string(n) +
         " without reaching the target accuracy: " + without;
}

void FlightEngine::assess_anchors(double now_s, std::span<const Estimate> estimates) {
  for (auto& task : state_.anchors) {
    if (task.done) continue;
    const auto it = std::find_if(estimates.begin(), estimates.end(),
                                 [&](const Estimate& e) { return e.anchor == task.id; });
    const auto estimate = it == estimates.end() ? std::nullopt : std::optional(*it);
    Progress progress;
    progress.iterations = task.iterations;
    progress.battery = vehicle_.battery;
    progress.elapsed_s = now_s - started_s_.value_or(now_s);
    if (estimate && estimate->verdict == Verdict::ok && holding_back(*estimate) == nullptr) {
      progress.sigma_m = position_sigma_m(*estimate);
      progress.gdop_root = estimate->gdop;
    }
    const auto rule = setup_.exit_rule(task.id);
    if (const auto exit = exit_of(rule, progress)) {
      task.done = true;
      task.reached = exit->reached;
      task.why = exit->reason;
      report(now_s, exit->reached ? EventLevel::info : EventLevel::warning, "anchor.done",
             to_string(task.id) + ": " + exit->reason);
    } else {
      task.why = why_not_done(estimate, measured_at_[task.id], rule);
    }
  }
}

void FlightEngine::finish(double now_s, Trigger trigger, std::string why) {
  if (decision_) decision_->outcome = std::string(to_string(trigger)) + ": " + why;
  feed(now_s, trigger, std::move(why));
}

void FlightEngine::decide(double now_s, std::span<const Estimate> estimates) {
  assess_anchors(now_s, estimates);
  const auto is_done = [&](NetworkId id) {
    return std::any_of(state_.anchors.begin(), state_.anchors.end(),
                       [&](const AnchorTask& a) { return a.id == id && a.done; });
  };
  if (!setup_.expected.empty() && std::all_of(setup_.expected.begin(), setup_.expected.end(), is_done)) {
    state_.waypoint = setup_.settings.waypoints.size() - 1;
    return finish(now_s, Trigger::done_here, outcome("expected"));
  }
  auto input = point_input(estimates);
  if (input.anchors.empty()) return finish(now_s, Trigger::done_here, outcome("received"));
  asked_ = ++n_tasks_;
  if (setup_.decides_apart)
    point_task_ = {n_tasks_, std::move(input), setup_.planner};
  else
    conclude(now_s, planning::next_point(input, setup_.planner));
}

planning::NextPointInput FlightEngine::point_input(std::span<const Estimate> estimates) const {
  planning::NextPointInput input;
  input.visited = state_.visited;
  input.current = state_.target_m;
  input.unreachable = state_.unreachable;
  input.bounds = setup_.limits.bounds;
  input.walls = setup_.walls;
  for (const auto& task : state_.anchors) {
    if (task.done) continue;
    planning::PlannedAnchor anchor;
    anchor.name = to_string(task.id);
    anchor.weight = weight_of(task);
    if (const auto wanted_m = setup_.exit_rule(task.id).target_sigma_m) anchor.target_m = *wanted_m;
    const auto it = std::find_if(estimates.begin(), estimates.end(),
                                 [&](const Estimate& e) { return e.anchor == task.id && e.best; });
    if (it == estimates.end()) {
      anchor.places = {{priors_.guess_m(task.id).value_or(setup_.middle_m), 1}};
      const auto seen = measured_at_.find(task.id);
      for (std::size_t i = 0; seen != measured_at_.end() && i < input.visited.size(); ++i) {
        if (std::ranges::find(seen->second, input.visited[i]) != seen->second.end())
          anchor.measured_at.push_back(i);
      }
    } else {
      anchor.places = {{it->best->position.m, it->best->probability}};
      if (it->mirror)
        anchor.places.push_back({it->mirror->position.m, std::max(1e-3, it->mirror->probability)});
      anchor.covariance_m2 = it->best->covariance_m2;
    }
    input.anchors.push_back(std::move(anchor));
  }
  return input;
}

void FlightEngine::decided(std::uint64_t number, Result<planning::Decision> decision) {
  if (asked_ == number) answer_ = std::move(decision);
}

void FlightEngine::conclude(double now_s, Result<planning::Decision> decided) {
  if (!decided) return finish(now_s, Trigger::no_point, decided.error().message);
  const double before = decided.value().value_before;
  DecisionRecord record;
  if (decision_ && decision_->predicted && std::isfinite(before)) record.reached = before;
  record.time_s = now_s;
  record.decision = std::move(decided).value();
  const auto chosen = record.decision.chosen;
  if (chosen) record.predicted = record.decision.candidates[*chosen].value;
  decision_ = std::move(record);
  if (!chosen) return finish(now_s, Trigger::no_point, decision_->decision.reason);
  if (state_.points > setup_.settings.points_per_waypoint) {
    return finish(now_s, Trigger::done_here,
                  std::to_string(state_.points) + " points measured at this waypoint");
  }
  const auto& best = decision_->decision.candidates[*chosen];
  // Logarithms have no shares: for d_optimal a step of the log volume counts as the share.
  const double gain = setup_.planner.rule == planning::Rule::d_optimal ? before - best.value
                      : std::isfinite(before)                          ? (before - best.value) / before
                                                                       : 1;
  if (gain < setup_.min_gain) {
    return finish(
        now_s, Trigger::done_here,
        "the best point would improve the result by only " + std::to_string(std::lround(100 * gain)) + " %");
  }
  const Eigen::Vector2d look = (setup_.middle_m - best.point_m).head<2>();
  decision_->outcome = "point: " + decision_->decision.reason;
  feed(now_s, Trigger::point, decision_->decision.reason, best.point_m, std::atan2(look.x(), look.y()));
}

bool FlightEngine::next_is_current() const {
  const auto step = state_.step == Step::hold ? state_.interrupted : state_.step;
  return step == Step::go_to_waypoint || step == Step::take_off;
}

bool FlightEngine::end_work(double now_s, NetworkId anchor, AnchorOrder order, const std::string& who) {
  const auto task = std::ranges::find(state_.anchors, anchor, &AnchorTask::id);
  if (task == state_.anchors.end()) return false;
  const auto tell = [&](std::string_view code, const std::string& why) {
    task->why = why;
    report(now_s, EventLevel::info, std::string(code), to_string(anchor) + ": " + why);
  };
  if (order == AnchorOrder::reopen) {
    if (task->ended_by.empty()) return false;
    task->done = task->reached = task->accepted = false;
    task->ended_by.clear();
    tell("anchor.reopened", "assessed again at the next point, ordered by " + who);
    return true;
  }
  task->done = true;
  task->reached = false;
  task->accepted = order == AnchorOrder::accept;
  task->ended_by = who;
  if (task->accepted)
    tell("anchor.accepted", "accepted by " + who);
  else
    tell("anchor.given_up", "given up by " + who);
  return true;
}

void FlightEngine::change_plan(double now_s, FlightSetup setup, std::size_t waypoint,
                               const std::string& why) {
  const FlightSetup was = std::exchange(setup_, std::move(setup));
  state_.waypoint = waypoint;
  point_task_.reset();
  asked_.reset();
  answer_.reset();
  for (auto& task : state_.anchors) {
    if (!task.done || !task.ended_by.empty() || same_aim(was.exit_rule(task.id), setup_.exit_rule(task.id)))
      continue;
    task.done = task.reached = false;
    task.why = "assessed again at the next point: the plan was changed";
  }
  report(now_s, EventLevel::info, "procedure.plan_changed", why);
  if (taken_over_) return;
  if (state_.step == Step::go_to_waypoint) {
    const auto& next = setup_.settings.waypoints.at(waypoint);
    state_.target_m = state_.centre_m = next.point_m;
    state_.heading_rad = next.heading_rad;
    state_.tries = 0;
    state_.deadline_s = now_s + setup_.settings.go_to_s;
    fly(now_s, next.point_m, next.heading_rad, false);
  } else if (!legs_.empty()) {
    fly(now_s, legs_.back(), state_.heading_rad, state_.step == Step::return_home);
  }
}

}  // namespace anchord::procedure
