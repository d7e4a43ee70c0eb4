#include "core/procedure/machine.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord::procedure {
namespace {

constexpr int k_directions = 3, k_quarters = 4, k_height_legs = 3;

const Waypoint& waypoint_of(const Settings& settings, const State& state) {
  return settings.waypoints.at(std::min(state.waypoint, settings.waypoints.size() - 1));
}

/// Somebody who is heard here and whose prior is missing.
template <class Missing>
bool any_in_range(const State& state, Missing missing) {
  return std::any_of(state.anchors.begin(), state.anchors.end(),
                     [&](const AnchorTask& a) { return a.samples_here > 0 && !a.done && missing(a); });
}

bool holds(Guard guard, const Settings& settings, const State& s) {
  switch (guard) {
    case Guard::always:
      return true;
    case Guard::wants_turn:
      return waypoint_of(settings, s).turn &&
             any_in_range(s, [](const AnchorTask& a) { return !a.has_bearing; });
    case Guard::wants_height:
      return waypoint_of(settings, s).height_search &&
             any_in_range(s, [](const AnchorTask& a) { return !a.has_height && !a.no_lobe; });
    case Guard::legs_left:
      return s.legs > 1;
    case Guard::moves_left:
      return s.moves < k_directions;
    case Guard::waypoint_left:
      return s.waypoint + 1 < settings.waypoints.size();
    case Guard::tries_left:
      return s.tries + 1 < settings.tries;
    case Guard::anything_sampled:
      return any_in_range(s, [](const AnchorTask&) { return true; });
    case Guard::was_returning:
      return s.interrupted == Step::return_home;
    case Guard::had_point:
      return s.interrupted == Step::go_to_point || s.interrupted == Step::check_connections ||
             s.interrupted == Step::go_back || (s.points > 0 && s.interrupted == Step::ranging);
  }
  return false;
}

double longest_s(const Settings& t, const State& s, Step step) {
  switch (step) {
    case Step::take_off:
      return t.take_off_s;
    case Step::go_to_waypoint:
    case Step::move_around:
    case Step::step_to_waypoint:
    case Step::go_to_point:
    case Step::go_back:
      return t.go_to_s;
    case Step::search_anchors:
      return t.search_s;
    case Step::turn:
      return t.turn_leg_s;
    case Step::height_search:
      return t.height_leg_s;
    case Step::ranging:
      return std::max(t.ranging_s, waypoint_of(t, s).dwell_s);
    case Step::find_next_point:
      return t.decide_s;
    case Step::check_connections:
      return t.connections_s;
    case Step::hold:
      return t.hold_s;
    case Step::return_home:
      return t.return_s;
    case Step::landing:
      return t.landing_s;
    case Step::ready:
    case Step::done:
      return 0;
  }
  return 0;
}

/// Says a step's work, once the transition is chosen.
class Entry {
 public:
  Entry(const Settings& settings, State& state, const Transition& way, const Input& input)
      : t_(settings), s_(state), way_(way), input_(input) {}
  std::vector<Command> run();

 private:
  bool again() const { return way_.from == way_.to && way_.guard == Guard::tries_left; }
  Command go_to() const { return {Command::Kind::go_to, s_.target_m, s_.heading_rad}; }
  Command only(Command::Kind kind) const { return {kind, {0, 0, 0}, std::nullopt}; }
  void to_waypoint();
  void part_of_the_way();
  void quarter();
  void height_leg();
  void forget_samples() {
    for (auto& a : s_.anchors) a.samples_here = 0;
  }
  void point_is_measured();

  const Settings& t_;
  State& s_;
  const Transition& way_;
  const Input& input_;
};

void Entry::to_waypoint() {
  if (again()) return;
  if (way_.guard == Guard::waypoint_left) ++s_.waypoint;
  s_.moves = s_.steps = s_.points = 0;
  s_.target_m = s_.centre_m = waypoint_of(t_, s_).point_m;
  s_.heading_rad = waypoint_of(t_, s_).heading_rad;
}

/// Eq 8.6; after k parts the next waypoint is reached and is the one we are at.
void Entry::part_of_the_way() {
  const Eigen::Vector3d from = waypoint_of(t_, s_).point_m, to = t_.waypoints[s_.waypoint + 1].point_m;
  ++s_.steps;
  s_.target_m = s_.centre_m = from + (to - from) * s_.steps / t_.k;
  if (s_.steps >= t_.k) {
    ++s_.waypoint;
    s_.steps = s_.moves = 0;
  }
}

void Entry::quarter() {
  s_.legs = way_.from == Step::turn ? s_.legs - 1 : k_quarters;
  const double heading = s_.heading_rad.value_or(0) + std::numbers::pi / 2;
  s_.heading_rad = std::fmod(heading, 2 * std::numbers::pi);
  if (s_.legs == 1) {
    // All round: whoever answered has a bearing now, or never will from here.
    for (auto& a : s_.anchors) a.has_bearing |= a.samples_here > 0;
  }
}

void Entry::height_leg() {
  s_.legs = way_.from == Step::height_search ? s_.legs - 1 : k_height_legs;
  if (s_.legs == k_height_legs) s_.former_m = s_.target_m;
  const double base = s_.former_m.z();
  const double up = s_.legs == 3 ? t_.search_height_m : s_.legs == 2 ? -t_.search_height_m : 0;
  s_.target_m = s_.former_m;
  s_.target_m.z() = std::clamp(base + up, t_.min_height_m, t_.max_height_m);
  if (s_.legs == 1) {
    for (auto& a : s_.anchors) a.has_height |= a.samples_here > 0 && !a.no_lobe;
  }
}

void Entry::point_is_measured() {
  s_.visited.push_back(s_.target_m);
  ++s_.points;
  for (auto& a : s_.anchors) {
    if (a.samples_here > 0) {
      ++a.iterations;
      a.waiting = 0;
    } else if (!a.done) {
      ++a.waiting;
    }
  }
}

std::vector<Command> Entry::run() {
  if (!again()) s_.tries = 0;
  if (again()) ++s_.tries;
  switch (way_.to) {
    case Step::ready:
    case Step::done:
      return {};
    case Step::take_off:
      return {{Command::Kind::take_off, {0, 0, t_.take_off_m}, std::nullopt}};
    case Step::go_to_waypoint:
      to_waypoint();
      return {go_to()};
    case Step::search_anchors:
      forget_samples();
      return {only(Command::Kind::measure)};
    case Step::move_around:
      s_.target_m = s_.centre_m + t_.move_m * Eigen::Vector3d::Unit(s_.moves);
      s_.target_m.z() = std::clamp(s_.target_m.z(), t_.min_height_m, t_.max_height_m);
      ++s_.moves;
      return {go_to()};
    case Step::step_to_waypoint:
      part_of_the_way();
      return {go_to()};
    case Step::turn:
      quarter();
      return {go_to()};
    case Step::height_search:
      height_leg();
      return {go_to()};
    case Step::ranging:
      forget_samples();
      return {only(Command::Kind::measure)};
    case Step::find_next_point:
      if (way_.from == Step::ranging) point_is_measured();
      return {only(Command::Kind::decide)};
    case Step::go_to_point:
      if (way_.trigger == Trigger::point) {
        s_.former_m = s_.target_m;
        s_.target_m = input_.point_m.value_or(s_.target_m);
        s_.heading_rad = input_.heading_rad;
      }
      return {go_to()};
    case Step::check_connections:
      forget_samples();
      return {only(Command::Kind::measure)};
    case Step::go_back:
      s_.unreachable.push_back(s_.target_m);
      s_.target_m = s_.former_m;
      return {go_to()};
    case Step::hold:
      s_.interrupted = way_.from;
      if (way_.trigger == Trigger::taken_over) return {};
      return {only(Command::Kind::hold)};
    case Step::return_home:
      return {only(Command::Kind::return_home)};
    case Step::landing:
      return {only(Command::Kind::land)};
  }
  return {};
}

/// After the work: nothing is measured any more.
bool is_over(Step step) { return step == Step::return_home || step == Step::landing || step == Step::done; }

/// The plan was flown to its end: what else leads home is an interruption, however it went on.
bool nothing_left(const Transition& way) {
  if (way.to != Step::return_home) return false;
  return way.trigger == Trigger::done_here || way.trigger == Trigger::no_point ||
         way.trigger == Trigger::skip ||
         (way.trigger == Trigger::timeout &&
          (way.from == Step::search_anchors || way.from == Step::find_next_point));
}

void note_end(State& s, const Transition& way) {
  if (way.to == Step::hold) return;
  if (!is_over(way.to)) {
    s.ended.clear();
    s.completed = s.by_person = false;
  } else if (s.ended.empty()) {
    s.ended = s.reason;
    s.completed = nothing_left(way);
  }
}

}  // namespace

Result<void> Settings::check() const {
  const auto bad = [](const char* text) { return make_error(Errc::invalid_argument, text); };
  if (waypoints.empty()) return bad("a flight needs at least one waypoint");
  if (k < 1 || tries < 1 || points_per_waypoint < 1)
    return bad("k, tries and points_per_waypoint must be at least 1");
  if (!(min_height_m < max_height_m)) return bad("min_height_m must be below max_height_m");
  for (const double s : {go_to_s, search_s, turn_leg_s, height_leg_s, ranging_s, decide_s, connections_s,
                         hold_s, take_off_s, landing_s, return_s}) {
    if (!(s > 0)) return bad("every step needs a time limit above 0 s");
  }
  return boost::outcome_v2::success();
}

Advance advance(const Settings& settings, const State& state, const Input& input) {
  Advance out{state, {}, nullptr};
  for (const auto& way : transitions()) {
    if (way.from == state.step && way.trigger == input.trigger && holds(way.guard, settings, state)) {
      out.transition = &way;
      break;
    }
  }
  if (out.transition == nullptr) return out;
  out.state.step = out.transition->to;
  out.state.since_s = input.now_s;
  out.state.reason = std::string(out.transition->reason);
  if (!input.text.empty()) out.state.reason += ": " + input.text;
  note_end(out.state, *out.transition);
  ++out.state.n_transitions;
  out.commands = Entry(settings, out.state, *out.transition, input).run();
  const double longest = longest_s(settings, out.state, out.state.step);
  out.state.deadline_s = longest > 0 ? input.now_s + longest : 0;
  return out;
}

bool note_range(State& state, NetworkId anchor) {
  const auto it = std::find_if(state.anchors.begin(), state.anchors.end(),
                               [&](const AnchorTask& a) { return a.id == anchor; });
  if (it != state.anchors.end()) {
    ++it->samples_here;
    return false;
  }
  AnchorTask task;
  task.id = anchor;
  task.samples_here = 1;
  state.anchors.push_back(std::move(task));
  return true;
}

double weight_of(const AnchorTask& task) { return task.done ? 0 : 1 + task.waiting; }

Advance resume_after_restart(const State& stored, double now_s) {
  Advance out{stored, {}, nullptr};
  if (stored.step == Step::ready || stored.step == Step::done) return out;
  out.state.since_s = now_s;
  out.state.deadline_s = 0;  // waits for the operator; the autopilot's battery failsafe stands behind it
  if (stored.step == Step::landing) {
    out.commands = {{Command::Kind::land, {0, 0, 0}, std::nullopt}};
    out.state.reason = "server restarted while landing: commanded to land again";
    return out;
  }
  if (stored.step != Step::hold) out.state.interrupted = stored.step;
  out.state.step = Step::hold;
  out.state.reason = "server restarted: commanded to hold, waiting for the operator";
  out.commands = {{Command::Kind::hold, {0, 0, 0}, std::nullopt}};
  return out;
}

}  // namespace anchord::procedure
