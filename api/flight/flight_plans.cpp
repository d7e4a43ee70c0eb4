// Plans changed, and the work on anchors ended, in flight, as it is asked for.
#include <algorithm>
#include <utility>

#include "api/flight/flight_state.hpp"
#include "api/planning/site_structures.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {
namespace {

constexpr int k_tries = 3;

Error cannot(std::string why) { return make_error(Errc::invalid_argument, std::move(why)); }

/// What a person has confirmed is what is taken.
Result<void> as_seen(const FlightService::PlanOrder& order, const flight::PlanProposal& proposal) {
  if (order.revision && *order.revision != proposal.plan.version)
    return cannot("the plan would be revision " + std::to_string(proposal.plan.version) + ", not " +
                  std::to_string(*order.revision) + ": read the difference again");
  const auto next = proposal.change.next + 1;
  if (order.next_waypoint && *order.next_waypoint != next)
    return cannot("the aircraft has moved on, waypoint " + std::to_string(next) +
                  " would be next now: read the difference again");
  return boost::outcome_v2::success();
}

}  // namespace

Result<FlightService::FlownPlan> FlightService::flown_plan(const MissionId& mission) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  const auto w = state_->work.lock();
  const auto* f = w->operations.flight_of(mission);
  if (f == nullptr)
    return make_error(Errc::not_found, "this mission has not been flown since the server started");
  return State::flown_by(*f);
}

FlightService::FlownPlan FlightService::State::flown_by(const flight::ActiveFlight& f) {
  const auto& c = f.changes;
  return {
      f.plan, c.n, c.at, c.by, c.saved_revision, c.former ? std::optional(c.former->version) : std::nullopt};
}

/// The plan that is asked for, by the walls of today; the store is asked without the lock.
Result<Plan> FlightService::State::wanted_plan(const MissionId& mission, bool undo) {
  Plan wanted;
  {
    const auto w = work.lock();
    const auto* f = w->operations.flight_of(mission);
    if (f == nullptr || !f->flying()) return cannot("this mission is not being flown");
    if (undo) {
      if (!f->changes.former)
        return cannot("the plan was not changed in this flight: there is nothing to undo");
      wanted = *f->changes.former;
      if (!f->changes.own_origin) wanted.origin.reset();
    } else {
      wanted.id = f->plan.id;
    }
  }
  if (!undo) {
    BOOST_OUTCOME_TRY(const auto stored, deps.plans.plan(wanted.id));
    wanted = plan_of(stored);
  }
  BOOST_OUTCOME_TRYV(deps.structures.join(wanted));
  return wanted;
}

Result<FlightService::PlanDifference> FlightService::plan_difference(const MissionId& mission,
                                                                     const PlanOrder& order) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  BOOST_OUTCOME_TRY(const auto wanted, state_->wanted_plan(mission, order.undo));
  std::optional<flight::ChangeBasis> basis;
  {
    const auto w = state_->work.lock();
    basis = w->operations.change_basis(state_->now(), mission);
  }
  if (!basis) return cannot("this mission is not being flown");
  auto proposal = flight::propose_change(*basis, wanted);
  return PlanDifference{std::move(basis->plan), std::move(proposal)};
}

Result<FlightService::PlanDifference> FlightService::take_plan(const MissionId& mission,
                                                               const PlanOrder& order, const Principal& who) {
  BOOST_OUTCOME_TRYV(renew_control(mission, order.lease, who));
  BOOST_OUTCOME_TRY(const auto wanted, state_->wanted_plan(mission, order.undo));
  for (int i = 0; i < k_tries; ++i) {
    std::optional<flight::ChangeBasis> basis;
    {
      const auto w = state_->work.lock();
      basis = w->operations.change_basis(state_->now(), mission);
    }
    if (!basis) return cannot("this mission is not being flown");
    // Long with many waypoints: computed while the flight goes on, and taken if that has not changed its
    // basis.
    auto proposal = flight::propose_change(*basis, wanted);
    BOOST_OUTCOME_TRYV(as_seen(order, proposal));
    BOOST_OUTCOME_TRY(const bool taken, state_->operate([&](auto& operations, const auto& now) {
      return operations.take_plan(now, mission, *basis, proposal, who.name);
    }));
    if (!taken) continue;
    return PlanDifference{std::move(basis->plan), std::move(proposal)};
  }
  return cannot(
      "the flight moves on faster than the change can be checked: command Hold, then take the change");
}

Result<void> FlightService::order_anchor(const MissionId& mission, NetworkId anchor,
                                         procedure::AnchorOrder order, const std::string& lease,
                                         const Principal& who) {
  BOOST_OUTCOME_TRYV(renew_control(mission, lease, who));
  // Estimates are read before the lock is taken: their strand asks for it.
  if (order == procedure::AnchorOrder::accept) {
    for (const auto& view : state_->deps.missions.live(mission)) {
      const auto e = std::ranges::find(view.estimates, anchor, &Estimate::anchor);
      if (e == view.estimates.end() || !e->best) return cannot(to_string(anchor) + " has no position yet");
      if (e->verdict != Verdict::ok)
        return cannot(
            to_string(anchor) + " is " + std::string(k_verdict_words.word(e->verdict)) +
            ", its position may be far off: fly where it can be measured from another side, or give it up");
    }
  }
  return state_->operate([&](auto& operations, const auto& now) {
    return operations.order_anchor(now, mission, anchor, order, who.name);
  });
}

void FlightService::plan_saved(const Plan& plan) {
  {
    auto w = state_->work.lock();
    w->operations.plan_saved(plan.id, plan.name, plan.version);
  }
  state_->publish_events();
}

}  // namespace anchord::api
