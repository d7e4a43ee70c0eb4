// What of a flight is shown: the topics of the procedure, and their GET twins.
#include <nlohmann/json.hpp>

#include "api/json/procedure_json.hpp"
#include "api/live/hub.hpp"
#include "api/services/flight_state.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

constexpr std::ptrdiff_t k_shown_commands = 30;
/// Of hundreds of anchors they are long to write, and the thread that writes them is that of safety.
constexpr double k_profiles_s = 0.5;

}  // namespace

nlohmann::ordered_json FlightService::State::procedure(const flight::ActiveFlight& f) const {
  const auto at = now();
  ProcedureView v;
  v.mission = f.mission;
  v.plan = f.plan.id.uuid == Uuid{} ? "" : to_string(f.plan.id);
  v.name = f.plan.name;
  v.plan_revision = f.plan.version;
  v.mode = f.manual ? "manual" : "auto";
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
  return procedure_json(v, f.control.engine(), f.frame);
}

/// The stepper once a second and with every transition, decisions once, profiles while they grow.
void FlightService::State::publish() {
  const bool soon = operations.take_shown_soon();
  if (!operations.flight()) return;
  const auto& f = *operations.flight();
  const auto at = now();
  const auto& engine = f.control.engine();
  const auto n = engine.state().n_transitions;
  const bool moved = n != last.shown;
  const auto key = to_string(f.mission);
  if (moved || soon || at.s - last.shown_s >= 1) {
    deps.hub.publish(Topic::procedure, to_wire(procedure(f)), at.utc.us(), key);
    last.shown_s = at.s;
  }
  publish_profiles(f, at, moved);
  if (moved && engine.decision())
    deps.hub.publish(Topic::mission_grid, to_wire(grid_json(f.mission, at.utc.us(), engine, f.frame)),
                     at.utc.us(), key);
  last.shown = n;
}

void FlightService::State::publish_profiles(const flight::ActiveFlight& f, const flight::Now& at,
                                            bool moved) {
  const auto step = f.control.engine().state().step;
  const bool turning = step == procedure::Step::turn, climbing = step == procedure::Step::height_search;
  if (!moved && (!(turning || climbing) || at.s - last.profiles_s < k_profiles_s)) return;
  last.profiles_s = at.s;
  const std::int64_t t_us = at.utc.us();
  const auto key = to_string(f.mission);
  for (const auto& [anchor, clues] : f.control.engine().clues()) {
    if (!clues.turn.empty() && (turning || moved))
      deps.hub.publish(Topic::mission_turn, to_wire(turn_json(f.mission, anchor, t_us, clues, turning)), t_us,
                       key + to_string(anchor), anchor);
    if (!clues.heights.empty() && (climbing || moved))
      deps.hub.publish(Topic::mission_height, to_wire(height_json(f.mission, anchor, t_us, clues, climbing)),
                       t_us, key + to_string(anchor), anchor);
  }
}

std::string FlightService::procedure_text(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  const auto* f = state_->operations.flight_of(mission);
  return f == nullptr ? std::string{} : to_wire(state_->procedure(*f));
}

std::string FlightService::grid_text(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  const auto* f = state_->operations.flight_of(mission);
  return f == nullptr
             ? std::string{}
             : to_wire(grid_json(mission, state_->deps.clock.now().us(), f->control.engine(), f->frame));
}

std::vector<std::string> FlightService::turn_texts(const MissionId& mission) {
  const std::scoped_lock lock(state_->mutex);
  std::vector<std::string> out;
  if (const auto* f = state_->operations.flight_of(mission)) {
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
  if (const auto* f = state_->operations.flight_of(mission)) {
    const bool running = f->control.engine().state().step == procedure::Step::height_search;
    for (const auto& [anchor, clues] : f->control.engine().clues()) {
      if (!clues.heights.empty())
        out.push_back(to_wire(height_json(mission, anchor, state_->deps.clock.now().us(), clues, running)));
    }
  }
  return out;
}

}  // namespace anchord::api
