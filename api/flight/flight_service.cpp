#include "api/flight/flight_service.hpp"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/flight/flight_state.hpp"
#include "api/flight/kept_outcome.hpp"
#include "api/planning/site_structures.hpp"
#include "core/localize/live_flight.hpp"
#include "core/ports/drone.hpp"
#include "core/ports/executor.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_checks = 64;

std::uint64_t structure_of(const Plan& plan) { return plan.structure ? plan.structure->version : 0; }

flight::Holder holder_of(const Principal& who) { return {who.token_id, who.name}; }

}  // namespace

FlightService::FlightService(Deps deps) : state_(std::make_unique<State>(std::move(deps))) {}
FlightService::~FlightService() { stop(); }

flight::Now FlightService::State::now() const {
  flight::Now out;
  out.utc = deps.clock.now();
  out.steady = deps.steady.now();
  out.s = deps.now_s
              ? deps.now_s()
              : std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  return out;
}

void FlightService::State::publish_events() {
  const std::scoped_lock one_at_a_time(publishing_);
  std::vector<flight::LogEvent> events;
  {
    auto w = work.lock();
    events = w->operations.take_events();
  }
  for (auto& event : events)
    deps.events.add(event.level, std::move(event.code), std::move(event.text), event.mission, event.place);
}

void FlightService::start() {
  if (!guarded("flight before the restart", [this] { state_->recover(); })) {
    state_->deps.events.add(
        EventLevel::critical, "procedure.lost",
        "the flight from before the restart cannot be read: the pilot has to fly the aircraft", std::nullopt);
  }
  if (state_->deps.now_s || state_->thread.joinable()) return;
  state_->thread = Thread("anchord-fly", [this] {
    using Steady = std::chrono::steady_clock;
    auto due = Steady::now();
    for (bool stopping = false; !stopping;) {
      (void)guarded("flight", [this] { step(); });
      // At a fixed rate; a round that came late is not made up for.
      due = std::max(due + std::chrono::milliseconds(100), Steady::now());
      auto w = state_->work.lock();
      stopping = w.wait_until(state_->wake, due, [](const auto& now) { return now.stopping; });
    }
  });
}

void FlightService::stop() {
  {
    auto w = state_->work.lock();
    if (std::exchange(w->stopping, true)) return;
    // Whoever stops the server in flight leaves an aircraft that stands, not one that goes on.
    w->operations.halt();
  }
  state_->wake.notify_all();
  state_->changed.notify_all();
  if (state_->thread.joinable()) state_->thread.join();
  auto w = state_->work.lock();
  w.wait(state_->idle, [](const auto& now) { return !now.apart.handed_over; });
}

bool FlightService::State::apart_is_due(Work& w) {
  return w.apart.any() && !w.stopping && !std::exchange(w.apart.handed_over, true);
}

void FlightService::State::work_apart() {
  auto w = work.lock();
  while (!w->stopping && piece_apart(w)) continue;
  w->apart.handed_over = false;
  idle.notify_all();
}

bool FlightService::State::piece_apart(Guard& w) {
  if (!w->operations.flight()) w->apart.drop();
  if (!w->apart.any()) return false;
  (void)guarded("planner", [&] {
    if (w->apart.point)
      decide(w);
    else if (std::exchange(w->apart.grid, false))
      show_grid(w);
    else if (std::exchange(w->apart.profiles, false))
      show_profiles(w);
  });
  return true;
}

/// One that fails is a decision that does not come in time.
void FlightService::State::decide(Guard& w) {
  const auto task = *std::exchange(w->apart.point, std::nullopt);
  auto decision = w.unlocked([&] { return planning::next_point(task.input, task.options); });
  w->operations.decided(task, std::move(decision));
}

void FlightService::step() {
  auto& s = *state_;
  // The estimates belong to the mission's strand, whose observer asks for our lock: never ask for both. Nor
  // is that strand waited for: safety is looked after here, whatever the estimator does.
  std::optional<MissionId> mission;
  std::optional<Lease> held;
  {
    const auto w = s.work.lock();
    mission = flight::wants_estimates(w->operations);
    held = w->operations.control(s.now());
  }
  const bool ended = held && s.deps.ended(held->token_id);
  std::optional<MissionService::LiveView> live;
  if (mission) live = s.deps.missions.live_at_hand(*mission);
  std::optional<flight::Operations::Estimates> estimates;
  if (live && live->origin) estimates = {*live->origin, std::move(live->estimates)};
  std::optional<State::ToKeep> keep;
  flight::ForMission given;
  State::Due due;
  {
    auto w = s.work.lock();
    const auto now = s.now();
    if (w->operations.flying())
      s.checks_apart.note(now.s);
    else
      s.checks_apart.pause();
    if (ended) w->operations.end_control(now, held->token_id);
    w->operations.round(now, estimates, live.has_value());
    if (auto task = w->operations.take_point_task()) w->apart.point = std::move(task);
    if (const auto& f = w->operations.flight()) {
      mission = f->mission;  // one that began meanwhile too
      if (w->last.flight != w->operations.n_flights()) w->last = {.flight = w->operations.n_flights()};
      State::note_landing(*w, *f);
      keep = State::to_keep(*w, *f);
      given = w->hand_over.take(w->operations);
    }
    due = State::due(*w, now);
  }
  s.publish_events();
  s.publish(due);
  bool due_apart = false;
  {
    auto w = s.work.lock();
    w->apart.grid |= due.grid;
    w->apart.profiles |= due.profiles;
    due_apart = State::apart_is_due(*w);
  }
  if (due_apart) s.deps.plan.post([&s] { s.work_apart(); });
  if (given.targets && mission) s.deps.missions.set_targets(*mission, *std::move(given.targets));
  if (given.priors && mission) s.deps.missions.set_priors(*mission, *std::move(given.priors));
  if (keep && mission) s.keep(*mission, *keep);
  s.changed.notify_all();
}

/// A flight is over on the ground: what aborted in the air is so once the pilot has it down.
void FlightService::State::note_landing(Work& w, const flight::ActiveFlight& f) {
  const auto aircraft = w.operations.drone();
  if (w.operations.flying()) {
    w.last.flew = true;
  } else if (w.last.flew && (f.manual || !aircraft || !aircraft->in_air)) {
    w.last.flew = false;
    w.landed.push_back(f.mission);
  }
}

std::vector<MissionId> FlightService::take_landed() {
  auto w = state_->work.lock();
  return std::exchange(w->landed, {});
}

void FlightService::on_fix(const Fix& fix) {
  auto w = state_->work.lock();
  w->operations.fix(state_->now(), fix);
}

void FlightService::on_range(const MissionId& mission, const RangeResult& result) {
  auto w = state_->work.lock();
  w->operations.range(state_->now(), mission, result);
}

Result<Lease> FlightService::take_control(const MissionId& mission, const Principal& who, bool by_force) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  return state_->operate([&](auto& operations, const auto& now) {
    return operations.take_control(now, mission, holder_of(who), by_force, to_string(make_uuid_v7(now.utc)));
  });
}

Result<Lease> FlightService::renew_control(const MissionId& mission, const std::string& key,
                                           const Principal& who) {
  auto w = state_->work.lock();
  return w->operations.renew_control(state_->now(), mission, key, holder_of(who));
}

Result<void> FlightService::release_control(const MissionId& mission, const std::string& key,
                                            const Principal& who) {
  return state_->operate([&](auto& operations, const auto& now) {
    return operations.release_control(now, mission, key, holder_of(who));
  });
}

std::optional<Lease> FlightService::control() {
  auto w = state_->work.lock();
  return w->operations.control(state_->now());
}

bool FlightService::flies(const MissionId& mission) {
  auto w = state_->work.lock();
  const auto* f = w->operations.flight_of(mission);
  // What was aborted in the air is up there still, whoever flies it.
  return f != nullptr && (f->flying() || w->last.flew);
}

std::optional<MissionId> FlightService::flown_with(const PlanId& plan) {
  auto w = state_->work.lock();
  const auto& f = w->operations.flight();
  return f && f->flying() && f->plan.id == plan ? std::optional(f->mission) : std::nullopt;
}

flight::Groundwork FlightService::State::groundwork(const Plan* plan) {
  const auto storage = deps.storage ? deps.storage() : StorageStatus{};
  flight::Groundwork ground{plan, nullptr, storage.writable, static_cast<double>(storage.disk_free_bytes)};
  if (plan == nullptr) return ground;
  {
    const auto kept = checks.lock();
    for (const auto& known : *kept) {
      if (known.plan == plan->id && known.revision == plan->version && known.structure == structure_of(*plan))
        ground.check = known.check;
    }
  }
  if (ground.check) return ground;
  if (auto checked = planning::check_plan(*plan))
    ground.check = std::make_shared<const planning::PlanCheck>(std::move(checked).value());
  auto kept = checks.lock();
  kept->push_back({plan->id, plan->version, structure_of(*plan), ground.check});
  if (kept->size() > k_checks) kept->pop_front();
  return ground;
}

Result<FlightCommand> FlightService::act(const MissionId& mission, const Order& order, const Principal& who) {
  BOOST_OUTCOME_TRY(const auto record, state_->deps.missions.mission(mission));
  std::optional<Plan> plan;
  if (order.action == flight::FlightAction::start) {
    if (!order.plan) return make_error(Errc::invalid_argument, "start needs plan: the plan to fly");
    BOOST_OUTCOME_TRY(const auto stored, state_->deps.plans.plan(*order.plan));
    plan = plan_of(stored);
    BOOST_OUTCOME_TRYV(state_->deps.structures.join(*plan));
  }
  std::optional<flight::Groundwork> ground;
  if (plan) ground = state_->groundwork(&*plan);
  auto given = state_->operate([&](auto& operations, const auto& now) -> Result<FlightCommand> {
    BOOST_OUTCOME_TRYV(operations.renew_control(now, mission, order.lease, holder_of(who)));
    return ground ? operations.begin(now, record, *ground, order.manual, who.name)
                  : operations.act(now, mission, order.action, who.name);
  });
  state_->changed.notify_all();
  return given;
}

Result<FlightCommand> FlightService::upload(const MissionId& mission, const std::string& what,
                                            const PlanId& plan_id, const std::string& lease,
                                            const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  BOOST_OUTCOME_TRY(const auto stored, state_->deps.plans.plan(plan_id));
  const Plan plan = plan_of(stored);
  auto w = state_->work.lock();
  const auto now = state_->now();
  BOOST_OUTCOME_TRYV(w->operations.renew_control(now, mission, lease, holder_of(who)));
  return w->operations.upload(now, mission, plan, what, who.name);
}

Result<DroneStatus> FlightService::change_aircraft(const MissionId& mission, const std::string& lease,
                                                   const std::string& sender, const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  return state_->operate([&](auto& operations, const auto& now) -> Result<DroneStatus> {
    BOOST_OUTCOME_TRYV(operations.renew_control(now, mission, lease, holder_of(who)));
    return operations.change_aircraft(mission, sender, who.name);
  });
}

std::vector<FlightUpload> FlightService::uploads(const MissionId& mission) {
  auto w = state_->work.lock();
  std::vector<FlightUpload> out;
  for (const auto& u : w->operations.uploads()) {
    if (u.mission == mission) out.push_back(u);
  }
  return out;
}

FlightCommand FlightService::settled(FlightCommand command, double wait_s) {
  auto w = state_->work.lock();
  const auto latest = [&](const auto& now) {
    const auto& operations = now.operations;
    if (const auto* found = operations.command(command.number)) command = *found;
    // A newer command ends the wait: who waits holds a thread that the next command may need.
    return command.state != CommandState::sent || now.stopping ||
           operations.newest_by_person() > command.number;
  };
  (void)w.wait_for(state_->changed, std::chrono::duration<double>(wait_s), latest);
  return command;
}

std::vector<ChecklistItem> FlightService::checklist(const MissionId& mission,
                                                    const std::optional<PlanId>& plan_id) {
  const auto record = state_->deps.missions.mission(mission);
  std::optional<Plan> plan;
  if (plan_id) {
    if (const auto stored = state_->deps.plans.plan(*plan_id)) plan = plan_of(stored.value());
    if (plan && !state_->deps.structures.join(*plan)) plan.reset();
  }
  const auto ground = state_->groundwork(plan ? &*plan : nullptr);
  auto w = state_->work.lock();
  return w->operations.checklist(state_->now(), record ? &record.value() : nullptr, mission, ground,
                                 state_->deps.drone == nullptr);
}

Result<void> FlightService::prepare(const MissionId& mission, const PlanId& plan_id) {
  BOOST_OUTCOME_TRY(const auto stored, state_->deps.plans.plan(plan_id));
  Plan plan = plan_of(stored);
  BOOST_OUTCOME_TRYV(state_->deps.structures.join(plan));
  auto w = state_->work.lock();
  w->operations.prepare(mission, plan);
  return boost::outcome_v2::success();
}

Result<void> FlightService::override_item(const MissionId& mission, const std::string& item,
                                          const std::string& reason, const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  if (!flight::is_checklist_item(item))
    return make_error(Errc::not_found, "the checklist has no item " + item);
  const auto ground = state_->groundwork(nullptr);
  return state_->operate([&](auto& operations, const auto& now) {
    return operations.override_item(now, mission, item, reason, who.name, ground);
  });
}

std::vector<std::pair<std::string_view, std::string>> FlightService::alarms() {
  auto w = state_->work.lock();
  return w->operations.alarms();
}

std::optional<MissionId> FlightService::mission() const {
  const auto w = state_->work.lock();
  const auto& flight = w->operations.flight();
  return flight ? std::optional(flight->mission) : std::nullopt;
}

std::string FlightService::metrics() const {
  return state_->checks_apart.text("anchord_safety_interval_seconds");
}

}  // namespace anchord::api
