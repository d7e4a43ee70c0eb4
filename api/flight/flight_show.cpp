// What of a flight is shown: the topics of the procedure, and their GET counterparts.
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "api/flight/flight_state.hpp"
#include "api/flight/plan_change_json.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/kit/late_writer.hpp"
#include "api/stream/hub.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/procedure_log.hpp"

namespace anchord::api {
namespace {

constexpr std::ptrdiff_t k_shown_commands = 30;
constexpr double k_profiles_s = 0.5;
constexpr double k_logged_profiles_s = 5;  // a turn takes a minute

/// What grows in a step.
std::optional<Topic> growing_in(procedure::Step step) {
  if (step == procedure::Step::turn) return Topic::mission_turn;
  if (step == procedure::Step::height_search) return Topic::mission_height;
  return std::nullopt;
}

GridView grid_of(const flight::ActiveFlight& f, std::int64_t t_us) {
  const auto& engine = f.control.engine();
  const auto& s = engine.state();
  const auto& planner = engine.setup().planner;
  return {f.mission, t_us,          planner.rule,      planner.combine,
          s.visited, s.unreachable, engine.decision(), f.frame};
}

/// Of every anchor, copied: of hundreds they are long to write.
struct Profiles {
  MissionId mission;
  std::map<NetworkId, procedure::Priors> priors;
  procedure::Step step;
  std::int64_t t_us;

  using Each = std::function<void(NetworkId, const nlohmann::ordered_json&)>;
  void turns(const Each& each) const {
    for (const auto& [anchor, one] : priors)
      if (!one.turn.empty())
        each(anchor, turn_json(mission, anchor, t_us, one, step == procedure::Step::turn));
  }
  void heights(const Each& each) const {
    for (const auto& [anchor, one] : priors)
      if (!one.heights.empty())
        each(anchor, height_json(mission, anchor, t_us, one, step == procedure::Step::height_search));
  }
};

Profiles profiles_of(const flight::ActiveFlight& f, std::int64_t t_us) {
  const auto& engine = f.control.engine();
  return {f.mission, engine.priors(), engine.state().step, t_us};
}

template <class State>
std::optional<Profiles> profiles_in(State& state, const MissionId& mission) {
  const auto w = state.work.lock();
  const auto* f = w->operations.flight_of(mission);
  return f == nullptr ? std::nullopt : std::optional(profiles_of(*f, state.deps.clock.now().us()));
}

}  // namespace

ProcedureView FlightService::State::procedure(const flight::Now& at, const flight::Operations& operations,
                                              const flight::ActiveFlight& f) {
  ProcedureView v;
  v.mission = f.mission;
  v.plan = f.plan.id.uuid == Uuid{} ? "" : to_string(f.plan.id);
  v.name = f.plan.name;
  v.plan_revision = f.plan.version;
  v.saved_revision = f.changes.saved_revision;
  if (f.changes.former) v.undo_revision = f.changes.former->version;
  v.plan_changes = f.changes.n;
  v.mode = flight::k_flight_mode_words.word(f.manual);
  v.status = f.status();
  v.ended = f.ended();
  v.forecast = f.forecast;
  v.t_us = at.utc.us();
  v.now_s = f.aborted.empty() ? at.s : f.aborted_s;
  if (!f.manual) v.drone = operations.drone();
  v.shift_m = f.control.shift_m();
  if (const auto held = operations.control(at)) {
    v.holder = held->name;
    v.holder_since_us = held->since.us();
    v.holder_until_us = held->until.us();
  }
  for (const auto& c : operations.commands()) {
    if (c.mission == f.mission) v.commands.push_back(c);
  }
  if (v.commands.size() > k_shown_commands)
    v.commands.erase(v.commands.begin(), v.commands.end() - k_shown_commands);
  read_engine(f.control.engine(), f.frame, v);
  return v;
}

/// The stepper once a second and with every transition. What is longer to write is left to be shown apart:
/// decisions once, profiles while they grow.
FlightService::State::Due FlightService::State::due(Work& w, const flight::Now& at) {
  Due out;
  const bool soon = w.operations.take_shown_soon();
  if (!w.operations.flight()) return out;
  const auto& f = *w.operations.flight();
  const auto& engine = f.control.engine();
  const auto n = engine.state().n_transitions;
  const bool moved = n != w.last.shown;
  if (moved || soon || at.s - w.last.shown_s >= 1) {
    out.procedure = procedure(at, w.operations, f);
    w.last.shown_s = at.s;
  }
  out.logged = moved || soon;
  if (out.logged && std::exchange(w.last.logged_changes, f.changes.n) != f.changes.n) out.plan = flown_by(f);
  if (moved || (growing_in(engine.state().step) && at.s - w.last.profiles_s >= k_profiles_s)) {
    out.profiles = true;
    w.last.profiles_s = at.s;
  }
  out.grid = moved && engine.decision();
  w.last.shown = n;
  return out;
}

void FlightService::State::log(const MissionId& mission, std::int64_t t_us, std::string_view topic,
                               std::vector<std::string> messages) const {
  std::vector<ProcedureEntry> entries;
  for (auto& text : messages)
    entries.push_back({UtcTime::from_us(t_us), std::string(topic), std::move(text)});
  if (entries.empty()) return;
  deps.late.write([&to = deps.procedure_log, mission,
                   entries = std::move(entries)] { return to.append(mission, entries); },
                  std::chrono::milliseconds{0});
}

void FlightService::State::publish(const Due& due) const {
  if (!due.procedure) return;
  const auto& view = *due.procedure;
  const auto text = to_wire(procedure_json(view));
  deps.hub.publish(Topic::procedure, text, view.t_us, to_string(view.mission), {}, view.mission);
  if (due.plan) log(view.mission, view.t_us, k_log_plan, {to_wire(flown_plan_json(view.mission, *due.plan))});
  if (due.logged) log(view.mission, view.t_us, info(Topic::procedure).name, {text});
}

void FlightService::State::show_grid(Guard& w) const {
  const auto grid = grid_of(*w->operations.flight(), now().utc.us());
  const auto decided_s = grid.decision ? std::optional(grid.decision->time_s) : std::nullopt;
  const bool logged = decided_s && std::exchange(w->last.logged_decision_s, *decided_s) != *decided_s;
  w.unlocked([&] {
    const auto text = to_wire(grid_json(grid));
    deps.hub.publish(Topic::mission_grid, text, grid.t_us, to_string(grid.mission), {}, grid.mission);
    if (logged) log(grid.mission, grid.t_us, info(Topic::mission_grid).name, {text});
  });
}

/// What has grown and is worth an entry: now and then, and as it ended.
std::optional<Topic> FlightService::State::take_grown(Last& last, procedure::Step step, double now_s) {
  const auto growing = growing_in(step);
  const auto before = std::exchange(last.growing, growing);
  if (before && before != growing) return before;
  if (!growing || now_s - last.logged_profiles_s < k_logged_profiles_s) return std::nullopt;
  last.logged_profiles_s = now_s;
  return growing;
}

void FlightService::State::show_profiles(Guard& w) const {
  const auto at = now();
  const auto profiles = profiles_of(*w->operations.flight(), at.utc.us());
  const auto grown = take_grown(w->last, profiles.step, at.s);
  const auto key = to_string(profiles.mission);
  std::vector<std::string> to_log;
  const auto to = [&](Topic topic) {
    return [&, topic](NetworkId anchor, const nlohmann::ordered_json& one) {
      auto text = to_wire(one);
      deps.hub.publish(topic, text, profiles.t_us, key + to_string(anchor), anchor, profiles.mission);
      if (topic == grown) to_log.push_back(std::move(text));
    };
  };
  w.unlocked([&] {
    profiles.turns(to(Topic::mission_turn));
    profiles.heights(to(Topic::mission_height));
    if (grown) log(profiles.mission, profiles.t_us, info(*grown).name, std::move(to_log));
  });
}

std::string FlightService::procedure_text(const MissionId& mission) {
  std::optional<ProcedureView> view;
  {
    const auto w = state_->work.lock();
    const auto* f = w->operations.flight_of(mission);
    if (f == nullptr) return {};
    view = State::procedure(state_->now(), w->operations, *f);
  }
  return to_wire(procedure_json(*view));
}

std::string FlightService::grid_text(const MissionId& mission) {
  std::optional<GridView> grid;
  {
    const auto w = state_->work.lock();
    const auto* f = w->operations.flight_of(mission);
    if (f == nullptr) return {};
    grid.emplace(grid_of(*f, state_->deps.clock.now().us()));
  }
  return to_wire(grid_json(*grid));
}

std::vector<std::string> FlightService::turn_texts(const MissionId& mission) {
  std::vector<std::string> out;
  if (const auto profiles = profiles_in(*state_, mission))
    profiles->turns([&](NetworkId, const auto& one) { out.push_back(to_wire(one)); });
  return out;
}

std::vector<std::string> FlightService::height_texts(const MissionId& mission) {
  std::vector<std::string> out;
  if (const auto profiles = profiles_in(*state_, mission))
    profiles->heights([&](NetworkId, const auto& one) { out.push_back(to_wire(one)); });
  return out;
}

}  // namespace anchord::api
