#include "api/services/flight_service.hpp"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "api/application.hpp"
#include "api/live/hub.hpp"
#include "api/services/event_log.hpp"
#include "api/services/flight_state.hpp"
#include "api/services/mission_service.hpp"
#include "core/base/to_wire.hpp"
#include "core/localize/live_flight.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {

using procedure::Event;

FlightService::FlightService(Deps deps) : state_(std::make_unique<State>(std::move(deps))) {}
FlightService::~FlightService() { stop(); }

void FlightService::start() {
  if (!guarded("flight before the restart", [this] { state_->recover(); })) {
    state_->deps.events.add("critical", "procedure.lost",
                            "the flight before the restart cannot be read: the pilot has it", std::nullopt);
  }
  if (state_->deps.now_s || state_->thread.joinable()) return;
  state_->thread = Thread("anchord-fly", [this] {
    using Steady = std::chrono::steady_clock;
    auto due = Steady::now();
    std::unique_lock lock(state_->mutex);
    while (!state_->stopping) {
      lock.unlock();
      (void)guarded("flight", [this] { step(); });
      // At a fixed rate; a round that came late is not made up for.
      due = std::max(due + std::chrono::milliseconds(100), Steady::now());
      lock.lock();
      state_->wake.wait_until(lock, due, [&] { return state_->stopping; });
    }
  });
}

void FlightService::stop() {
  {
    const std::scoped_lock lock(state_->mutex);
    if (state_->stopping) return;
    state_->stopping = true;
    // Whoever stops the server in flight leaves an aircraft that stands, not one that goes on.
    // One that lands, or that the pilot has, is left to it.
    if (state_->flight && state_->flight->flying() && !state_->flight->manual &&
        state_->deps.drone != nullptr && !state_->flight->control.taken_over() &&
        state_->flight->control.engine().state().step != procedure::Step::landing)
      state_->deps.drone->hold();
  }
  state_->wake.notify_all();
  state_->changed.notify_all();
  if (state_->thread.joinable()) state_->thread.join();
}

void FlightService::step() {
  auto& s = *state_;
  // The estimates belong to the mission's strand, whose observer asks for our lock: never ask for both. Nor
  // is that strand waited for: safety is looked after here, whatever the estimator does.
  std::optional<MissionId> mission;
  bool deciding = false;
  {
    const std::scoped_lock lock(s.mutex);
    if (s.flight) {
      mission = s.flight->mission;
      deciding = s.flight->control.engine().state().step == procedure::Step::find_next_point;
    }
  }
  std::optional<MissionService::LiveView> live;
  if (deciding) live = s.deps.missions.live_at_hand(*mission);
  std::string keep;
  bool keeps = false;
  std::optional<procedure::FlightClues> clues;
  {
    const std::scoped_lock lock(s.mutex);
    s.round(live ? &*live : nullptr);
    if (s.flight) {
      if (!s.flight->manual) s.flight->aircraft = s.deps.drone->status().identity;
      keeps = s.flight->to_keep(keep);
    }
    if (s.flight && s.flight->clues_told != s.flight->control.engine().clues_version()) {
      s.flight->clues_told = s.flight->control.engine().clues_version();
      clues = s.flight->clues();
    }
    s.publish();
  }
  if (clues && mission) s.deps.missions.tell_clues(*mission, std::move(*clues));
  if (keeps && mission) s.keep(*mission, std::move(keep));
  s.changed.notify_all();
}

void FlightService::on_fix(const Fix& fix) {
  const std::scoped_lock lock(state_->mutex);
  state_->hear(fix);
}

void FlightService::on_range(const MissionId& mission, const RangeResult& result) {
  const std::scoped_lock lock(state_->mutex);
  state_->hear(mission, result);
}

Result<Lease> FlightService::take_control(const MissionId& mission, const Principal& who, bool by_force) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  const std::scoped_lock lock(state_->mutex);
  const auto now = state_->moment();
  const auto before = state_->lease.holder(now);
  // Who has the aircraft of a mission that is not being flown keeps nobody from today's.
  const bool idle =
      before && before->mission != mission &&
      !(state_->flight && state_->flight->flying() && state_->flight->mission == before->mission);
  auto lease = state_->lease.take(mission, who, now, by_force || idle);
  if (lease) {
    state_->deps.events.add(before ? "warning" : "info", "control.taken",
                            who.name + (before ? " took control from " + before->name : " has control"),
                            mission);
    state_->publish_soon();
  }
  return lease;
}

Result<Lease> FlightService::renew_control(const MissionId& mission, const std::string& key,
                                           const Principal& who) {
  const std::scoped_lock lock(state_->mutex);
  return state_->lease.renew(mission, key, who, state_->moment());
}

Result<void> FlightService::release_control(const MissionId& mission, const std::string& key,
                                            const Principal& who) {
  const std::scoped_lock lock(state_->mutex);
  BOOST_OUTCOME_TRYV(state_->lease.release(mission, key, who, state_->moment()));
  state_->deps.events.add("info", "control.released", who.name + " gave control back", mission);
  state_->publish_soon();
  return boost::outcome_v2::success();
}

std::optional<Lease> FlightService::control() {
  const std::scoped_lock lock(state_->mutex);
  return state_->lease.holder(state_->moment());
}

bool FlightService::flies(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  const auto* flight = state_->flight_of(mission);
  return flight != nullptr && flight->flying();
}

std::optional<MissionId> FlightService::flown_with(const PlanId& plan) {
  const std::scoped_lock lock(state_->mutex);
  const auto& flight = state_->flight;
  return flight && flight->flying() && flight->plan.id == plan ? std::optional(flight->mission)
                                                               : std::nullopt;
}

Result<FlightCommand> FlightService::act(const MissionId& mission, const Order& order, const Principal& who) {
  BOOST_OUTCOME_TRY(const auto record, state_->deps.missions.mission(mission));
  std::optional<Plan> plan;
  if (order.action == "start") {
    if (!order.plan) return make_error(Errc::invalid_argument, "start needs the plan that is to be flown");
    BOOST_OUTCOME_TRY(const auto stored, state_->deps.plans.plan(*order.plan));
    plan = plan_of(stored);
  }
  std::optional<State::Groundwork> ground;
  if (plan) ground = state_->groundwork(&*plan);
  const std::scoped_lock lock(state_->mutex);
  BOOST_OUTCOME_TRYV(state_->lease.renew(mission, order.lease, who, state_->moment()));
  auto given =
      ground ? state_->begin(record, *ground, order.manual, who) : state_->obey(mission, order.action, who);
  state_->changed.notify_all();
  return given;
}

Result<FlightCommand> FlightService::upload(const MissionId& mission, const std::string& what,
                                            const PlanId& plan_id, const std::string& lease,
                                            const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  BOOST_OUTCOME_TRY(const auto stored, state_->deps.plans.plan(plan_id));
  const Plan plan = plan_of(stored);
  const std::scoped_lock lock(state_->mutex);
  BOOST_OUTCOME_TRYV(state_->lease.renew(mission, lease, who, state_->moment()));
  return state_->upload(mission, plan, what, who.name);
}

Result<DroneStatus> FlightService::change_aircraft(const MissionId& mission, const std::string& lease,
                                                   const std::string& sender, const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  const std::scoped_lock lock(state_->mutex);
  BOOST_OUTCOME_TRYV(state_->lease.renew(mission, lease, who, state_->moment()));
  auto* drone = state_->deps.drone;
  if (drone == nullptr)
    return make_error(Errc::invalid_argument, "this server talks to no autopilot (drone.address)");
  const auto before = drone->status();
  if (before.connected && (before.in_air || (state_->flight && state_->flight->flying())))
    return make_error(Errc::invalid_argument,
                      "the aircraft in the air answers; land it before another one takes the link");
  drone->change_peer(sender);
  state_->deps.events.add(
      "warning", "drone.changed",
      who.name + (sender.empty() ? ": the next autopilot whose heartbeat is received is the aircraft"
                                 : ": the autopilot at " + sender + " is the aircraft"),
      mission);
  return drone->status();
}

std::vector<FlightUpload> FlightService::uploads(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  std::vector<FlightUpload> out;
  for (const auto& u : state_->uploads) {
    if (u.mission == mission) out.push_back(u);
  }
  return out;
}

FlightCommand FlightService::settled(FlightCommand command, double wait_s) {
  std::unique_lock lock(state_->mutex);
  const auto latest = [&] {
    if (const auto* found = state_->find(command.number)) command = *found;
    // A newer command ends the wait: who waits holds a thread that the next command may need.
    return command.state != "sent" || state_->stopping || state_->newest_by_person > command.number;
  };
  state_->changed.wait_for(lock, std::chrono::duration<double>(wait_s), latest);
  return command;
}

std::vector<ChecklistItem> FlightService::checklist(const MissionId& mission,
                                                    const std::optional<PlanId>& plan_id,
                                                    const Principal& who) {
  const auto record = state_->deps.missions.mission(mission);
  std::optional<Plan> plan;
  if (plan_id) {
    if (const auto stored = state_->deps.plans.plan(*plan_id)) plan = plan_of(stored.value());
  }
  const auto ground = state_->groundwork(plan ? &*plan : nullptr);
  const std::scoped_lock lock(state_->mutex);
  if (plan && (who.has(Role::op) || who.has(Role::admin))) state_->preparing.emplace(mission, *plan);
  return state_->checklist(record ? &record.value() : nullptr, mission, ground,
                           state_->deps.drone == nullptr);
}

Result<void> FlightService::override_item(const MissionId& mission, const std::string& item,
                                          const std::string& reason, const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  if (!is_checklist_item(item)) return make_error(Errc::not_found, "the checklist has no item " + item);
  const auto ground = state_->groundwork(nullptr);
  const std::scoped_lock lock(state_->mutex);
  for (const auto& one : state_->checklist(nullptr, mission, ground, state_->deps.drone == nullptr)) {
    if (one.id == item && !one.overridable)
      return make_error(Errc::invalid_argument, item + " cannot be overridden: " + one.text);
  }
  state_->said[mission][item] = {who.name, reason};
  state_->deps.events.add("info", "checklist." + item, who.name + ": " + reason, mission);
  return boost::outcome_v2::success();
}

std::string FlightService::procedure_text(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  const auto* flight = state_->flight_of(mission);
  return flight == nullptr ? std::string{} : to_wire(state_->procedure(*flight));
}

std::string FlightService::grid_text(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  const auto* f = state_->flight_of(mission);
  return f == nullptr
             ? std::string{}
             : to_wire(grid_json(mission, state_->deps.clock.now().us(), f->control.engine(), f->frame));
}

std::vector<std::string> FlightService::turn_texts(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  std::vector<std::string> out;
  if (const auto* f = state_->flight_of(mission)) {
    const bool running = f->control.engine().state().step == procedure::Step::turn;
    for (const auto& [anchor, clues] : f->control.engine().clues()) {
      if (!clues.turn.empty())
        out.push_back(to_wire(turn_json(mission, anchor, state_->deps.clock.now().us(), clues, running)));
    }
  }
  return out;
}

std::vector<std::string> FlightService::height_texts(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  std::vector<std::string> out;
  if (const auto* f = state_->flight_of(mission)) {
    const bool running = f->control.engine().state().step == procedure::Step::height_search;
    for (const auto& [anchor, clues] : f->control.engine().clues()) {
      if (!clues.heights.empty())
        out.push_back(to_wire(height_json(mission, anchor, state_->deps.clock.now().us(), clues, running)));
    }
  }
  return out;
}

std::vector<std::pair<std::string_view, std::string>> FlightService::alarms() {
  const std::scoped_lock lock(state_->mutex);
  return state_->alarms();
}

std::string FlightService::metrics() const {
  return state_->checks_apart.text("anchord_safety_interval_seconds");
}

}  // namespace anchord::api
