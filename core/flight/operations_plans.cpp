// What a person changes in flight: the plan (who asks, what it stands on, from when it is flown), and the
// work on an anchor.
#include <utility>

#include "core/flight/operations.hpp"

namespace anchord::flight {

std::optional<ChangeBasis> Operations::change_basis(const Now& now, const MissionId& mission) const {
  const auto* f = flight_of(mission);
  if (f == nullptr || !f->flying()) return std::nullopt;
  const auto& engine = f->control.engine();
  ChangeBasis out{.plan = f->plan,
                  .own_origin = f->changes.own_origin,
                  .kept = f->changes.kept,
                  .autopilot_keeps = f->changes.autopilot_keeps,
                  .frame = f->frame,
                  .home_m = f->home_m};
  out.step = engine.state().step;
  out.waypoint = engine.state().waypoint;
  out.next_is_current = engine.next_is_current();
  out.position_m = engine.position_m();
  if (drone_ != nullptr && !f->manual) out.battery = drone_->status().battery;
  out.flown_s = engine.flown_s(now.s);
  out.decides_apart = decides_apart_;
  out.n_flight = n_flights_;
  out.n_changes = f->changes.n;
  return out;
}

Result<bool> Operations::take_plan(const Now& now, const MissionId& mission, const ChangeBasis& basis,
                                   const PlanProposal& proposal, const std::string& who) {
  const auto present = change_basis(now, mission);
  if (!present) return make_error(Errc::invalid_argument, "this mission is not being flown");
  const bool moved_on = present->n_flight != basis.n_flight || present->n_changes != basis.n_changes ||
                        present->waypoint != basis.waypoint ||
                        present->next_is_current != basis.next_is_current;
  if (moved_on) return false;
  auto refused = proposal.refused;
  if (refused.empty()) refused = refuse_from_here(proposal, present->position_m);
  std::string all;
  for (const auto& why : refused) all += (all.empty() ? "" : "; ") + why;
  if (!all.empty()) return make_error(Errc::invalid_argument, all);
  auto& f = *flight_;
  const auto before = f.plan.version;
  f.changes.former = std::exchange(f.plan, proposal.plan);
  f.changes.kept = proposal.kept;
  f.changes.at = now.utc;
  f.changes.by = who;
  ++f.changes.n;
  const auto& rest = proposal.after_s;
  f.forecast = planning::FlightTime{basis.flown_s + rest.low_s, basis.flown_s + rest.expected_s,
                                    basis.flown_s + rest.high_s};
  const std::string what = f.plan.name + ": revision " + std::to_string(f.plan.version) +
                           " is flown from waypoint " + std::to_string(proposal.change.next + 1) +
                           " on, revision " + std::to_string(before) + " before; taken by " + who;
  f.control.change_plan(now.s, *proposal.setup, proposal.waypoint, what);
  note_dispatched(now, f, nullptr);
  take_events(f);
  show_soon_ = true;
  return true;
}

Result<void> Operations::order_anchor(const Now& now, const MissionId& mission, NetworkId anchor,
                                      procedure::AnchorOrder order, const std::string& who) {
  const auto* flown = flight_of(mission);
  if (flown == nullptr || !flown->flying())
    return make_error(
        Errc::invalid_argument,
        "this mission is not being flown: anchors of a finished flight are accepted in its review");
  auto& f = *flight_;
  if (!f.control.engine().end_work(now.s, anchor, order, who))
    return make_error(
        Errc::invalid_argument,
        order == procedure::AnchorOrder::reopen
            ? to_string(anchor) + " was neither accepted nor given up: there is nothing to take back"
            : "no range of " + to_string(anchor) + " has been received in this flight");
  ++f.changes.n_anchor_orders;
  take_events(f);
  show_soon_ = true;
  return boost::outcome_v2::success();
}

void Operations::plan_saved(const PlanId& plan, const std::string& name, std::uint64_t revision) {
  if (!flying() || flight_->plan.id != plan) return;
  flight_->changes.saved_revision = revision;
  log_event(EventLevel::info, "plan.waiting",
            name + ": revision " + std::to_string(revision) + " is saved, revision " +
                std::to_string(flight_->plan.version) + " is flown until the change is taken",
            flight_->mission);
  show_soon_ = true;
}

}  // namespace anchord::flight
