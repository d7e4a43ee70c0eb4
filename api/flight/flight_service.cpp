#include "api/flight/flight_service.hpp"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/flight/flight_state.hpp"
#include "core/localize/live_flight.hpp"
#include "core/ports/drone.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_checks = 64;

flight::Holder holder_of(const Principal& who) { return {who.token_id, who.name}; }

}  // namespace

FlightService::FlightService(Deps deps) : state_(std::make_unique<State>(std::move(deps))) {}
FlightService::~FlightService() { stop(); }

flight::Now FlightService::State::now() const {
  flight::Now out;
  out.utc = deps.clock.now();
  out.steady = (deps.steady != nullptr ? *deps.steady : system_steady_clock()).now();
  out.s = deps.now_s
              ? deps.now_s()
              : std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  return out;
}

void FlightService::State::tell_events() {
  for (auto& event : operations.take_events())
    deps.events.add(std::move(event.level), std::move(event.code), std::move(event.text), event.mission);
}

void FlightService::start() {
  if (!guarded("flight before the restart", [this] { state_->recover(); })) {
    state_->deps.events.add("critical", "procedure.lost",
                            "the flight before the restart cannot be read: the pilot has it", std::nullopt);
  }
  if (state_->deps.now_s || state_->thread.joinable()) return;
  state_->helper = Thread("anchord-plan", [this] {
    std::unique_lock lock(state_->mutex);
    while (!state_->stopping) {
      if (!state_->work_apart(lock)) state_->due.wait(lock);
    }
  });
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
    state_->operations.halt();
  }
  state_->wake.notify_all();
  state_->changed.notify_all();
  state_->due.notify_all();
  if (state_->thread.joinable()) state_->thread.join();
  if (state_->helper.joinable()) state_->helper.join();
}

bool FlightService::State::work_apart(std::unique_lock<std::mutex>& lock) {
  if (!operations.flight()) apart = {};
  if (!apart.any()) return false;
  (void)guarded("planner", [&] {
    if (apart.point)
      decide(lock);
    else if (std::exchange(apart.grid, false))
      show_grid(lock);
    else if (std::exchange(apart.profiles, false))
      show_profiles(lock);
  });
  if (!lock.owns_lock()) lock.lock();
  return true;
}

/// One that fails is a decision that does not come in time.
void FlightService::State::decide(std::unique_lock<std::mutex>& lock) {
  const auto task = *std::exchange(apart.point, std::nullopt);
  lock.unlock();
  auto decision = planning::next_point(task.input, task.options);
  lock.lock();
  operations.decided(task, std::move(decision));
}

void FlightService::step() {
  auto& s = *state_;
  // The estimates belong to the mission's strand, whose observer asks for our lock: never ask for both. Nor
  // is that strand waited for: safety is looked after here, whatever the estimator does.
  std::optional<MissionId> mission;
  bool deciding = false;
  {
    const std::scoped_lock lock(s.mutex);
    if (const auto& f = s.operations.flight()) {
      mission = f->mission;
      deciding = f->control.engine().state().step == procedure::Step::find_next_point;
    }
  }
  std::optional<MissionService::LiveView> live;
  if (deciding) live = s.deps.missions.live_at_hand(*mission);
  std::optional<flight::Operations::Estimates> estimates;
  if (live && live->origin) estimates = {*live->origin, std::move(live->estimates)};
  std::string keep;
  bool keeps = false;
  std::optional<procedure::FlightClues> clues;
  {
    std::unique_lock lock(s.mutex);
    const auto now = s.now();
    if (s.operations.flying())
      s.checks_apart.note(now.s);
    else
      s.checks_apart.pause();
    s.operations.round(now, estimates, live.has_value());
    if (auto task = s.operations.take_point_task()) s.apart.point = std::move(task);
    s.tell_events();
    if (const auto& f = s.operations.flight()) {
      mission = f->mission;  // one that began meanwhile too
      if (s.last.flight != s.operations.n_flights()) s.last = {.flight = s.operations.n_flights()};
      keeps = s.to_keep(keep);
      if (const auto version = f->control.engine().clues_version(); s.last.clues_passed != version) {
        s.last.clues_passed = version;
        clues = f->clues();
      }
    }
    s.publish();
    if (s.helper.joinable())
      s.due.notify_one();
    else
      while (s.work_apart(lock)) continue;
  }
  if (clues && mission) s.deps.missions.tell_clues(*mission, std::move(*clues));
  if (keeps && mission) s.keep(*mission, std::move(keep));
  s.changed.notify_all();
}

void FlightService::on_fix(const Fix& fix) {
  const std::scoped_lock lock(state_->mutex);
  state_->operations.fix(state_->now(), fix);
}

void FlightService::on_range(const MissionId& mission, const RangeResult& result) {
  const std::scoped_lock lock(state_->mutex);
  state_->operations.range(state_->now(), mission, result);
}

Result<Lease> FlightService::take_control(const MissionId& mission, const Principal& who, bool by_force) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  const std::scoped_lock lock(state_->mutex);
  const auto now = state_->now();
  auto lease = state_->operations.take_control(now, mission, holder_of(who), by_force,
                                               to_string(make_uuid_v7(now.utc)));
  state_->tell_events();
  return lease;
}

Result<Lease> FlightService::renew_control(const MissionId& mission, const std::string& key,
                                           const Principal& who) {
  const std::scoped_lock lock(state_->mutex);
  return state_->operations.renew_control(state_->now(), mission, key, holder_of(who));
}

Result<void> FlightService::release_control(const MissionId& mission, const std::string& key,
                                            const Principal& who) {
  const std::scoped_lock lock(state_->mutex);
  auto released = state_->operations.release_control(state_->now(), mission, key, holder_of(who));
  state_->tell_events();
  return released;
}

std::optional<Lease> FlightService::control() {
  const std::scoped_lock lock(state_->mutex);
  return state_->operations.control(state_->now());
}

bool FlightService::flies(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  const auto* f = state_->operations.flight_of(mission);
  return f != nullptr && f->flying();
}

std::optional<MissionId> FlightService::flown_with(const PlanId& plan) {
  const std::scoped_lock lock(state_->mutex);
  const auto& f = state_->operations.flight();
  return f && f->flying() && f->plan.id == plan ? std::optional(f->mission) : std::nullopt;
}

flight::Groundwork FlightService::State::groundwork(const Plan* plan) {
  const auto storage = deps.storage ? deps.storage() : StorageStatus{};
  flight::Groundwork ground{plan, nullptr, storage.writable, static_cast<double>(storage.disk_free_bytes)};
  if (plan == nullptr) return ground;
  {
    const std::scoped_lock lock(checks_mutex);
    for (const auto& known : checks) {
      if (known.plan == plan->id && known.revision == plan->version) ground.check = known.check;
    }
  }
  if (ground.check) return ground;
  if (auto checked = planning::check_plan(*plan))
    ground.check = std::make_shared<const planning::PlanCheck>(std::move(checked).value());
  const std::scoped_lock lock(checks_mutex);
  checks.push_back({plan->id, plan->version, ground.check});
  if (checks.size() > k_checks) checks.pop_front();
  return ground;
}

Result<FlightCommand> FlightService::act(const MissionId& mission, const Order& order, const Principal& who) {
  BOOST_OUTCOME_TRY(const auto record, state_->deps.missions.mission(mission));
  std::optional<Plan> plan;
  if (order.action == flight::FlightAction::start) {
    if (!order.plan) return make_error(Errc::invalid_argument, "start needs the plan that is to be flown");
    BOOST_OUTCOME_TRY(const auto stored, state_->deps.plans.plan(*order.plan));
    plan = plan_of(stored);
  }
  std::optional<flight::Groundwork> ground;
  if (plan) ground = state_->groundwork(&*plan);
  const std::scoped_lock lock(state_->mutex);
  auto& operations = state_->operations;
  const auto now = state_->now();
  BOOST_OUTCOME_TRYV(operations.renew_control(now, mission, order.lease, holder_of(who)));
  auto given = ground ? operations.begin(now, record, *ground, order.manual, who.name)
                      : operations.act(now, mission, order.action, who.name);
  state_->tell_events();
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
  const auto now = state_->now();
  BOOST_OUTCOME_TRYV(state_->operations.renew_control(now, mission, lease, holder_of(who)));
  return state_->operations.upload(now, mission, plan, what, who.name);
}

Result<DroneStatus> FlightService::change_aircraft(const MissionId& mission, const std::string& lease,
                                                   const std::string& sender, const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  const std::scoped_lock lock(state_->mutex);
  BOOST_OUTCOME_TRYV(state_->operations.renew_control(state_->now(), mission, lease, holder_of(who)));
  auto changed = state_->operations.change_aircraft(mission, sender, who.name);
  state_->tell_events();
  return changed;
}

std::vector<FlightUpload> FlightService::uploads(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  std::vector<FlightUpload> out;
  for (const auto& u : state_->operations.uploads()) {
    if (u.mission == mission) out.push_back(u);
  }
  return out;
}

FlightCommand FlightService::settled(FlightCommand command, double wait_s) {
  std::unique_lock lock(state_->mutex);
  const auto latest = [&] {
    const auto& operations = state_->operations;
    if (const auto* found = operations.command(command.number)) command = *found;
    // A newer command ends the wait: who waits holds a thread that the next command may need.
    return command.state != CommandState::sent || state_->stopping ||
           operations.newest_by_person() > command.number;
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
  if (plan && (who.has(Role::op) || who.has(Role::admin))) state_->operations.prepare(mission, *plan);
  return state_->operations.checklist(state_->now(), record ? &record.value() : nullptr, mission, ground,
                                      state_->deps.drone == nullptr);
}

Result<void> FlightService::override_item(const MissionId& mission, const std::string& item,
                                          const std::string& reason, const Principal& who) {
  BOOST_OUTCOME_TRYV(state_->deps.missions.mission(mission));
  if (!flight::is_checklist_item(item))
    return make_error(Errc::not_found, "the checklist has no item " + item);
  const auto ground = state_->groundwork(nullptr);
  const std::scoped_lock lock(state_->mutex);
  auto done = state_->operations.override_item(state_->now(), mission, item, reason, who.name, ground);
  state_->tell_events();
  return done;
}

std::vector<std::pair<std::string_view, std::string>> FlightService::alarms() {
  const std::scoped_lock lock(state_->mutex);
  return state_->operations.alarms();
}

std::string FlightService::metrics() const {
  return state_->checks_apart.text("anchord_safety_interval_seconds");
}

}  // namespace anchord::api
