// What of a flight is shown: the topics of the procedure, and their GET counterparts.
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "api/flight/flight_state.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/stream/hub.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

constexpr std::ptrdiff_t k_shown_commands = 30;
constexpr double k_profiles_s = 0.5;

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
  const auto step = engine.state().step;
  const bool growing = step == procedure::Step::turn || step == procedure::Step::height_search;
  if (moved || (growing && at.s - w.last.profiles_s >= k_profiles_s)) {
    out.profiles = true;
    w.last.profiles_s = at.s;
  }
  out.grid = moved && engine.decision();
  w.last.shown = n;
  return out;
}

void FlightService::State::publish(const ProcedureView& view) const {
  deps.hub.publish(Topic::procedure, to_wire(procedure_json(view)), view.t_us, to_string(view.mission), {},
                   view.mission);
}

void FlightService::State::show_grid(Guard& w) const {
  const auto grid = grid_of(*w->operations.flight(), now().utc.us());
  w.unlocked([&] {
    deps.hub.publish(Topic::mission_grid, to_wire(grid_json(grid)), grid.t_us, to_string(grid.mission), {},
                     grid.mission);
  });
}

void FlightService::State::show_profiles(Guard& w) const {
  const auto profiles = profiles_of(*w->operations.flight(), now().utc.us());
  const auto key = to_string(profiles.mission);
  const auto to = [&](Topic topic) {
    return [&, topic](NetworkId anchor, const nlohmann::ordered_json& one) {
      deps.hub.publish(topic, to_wire(one), profiles.t_us, key + to_string(anchor), anchor, profiles.mission);
    };
  };
  w.unlocked([&] {
    profiles.turns(to(Topic::mission_turn));
    profiles.heights(to(Topic::mission_height));
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
