#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"

namespace anchord::procedure {

/// Steps of a calibration flight, Fig 8.3; the words are those of docs/procedure.md.
enum class Step : std::uint8_t {
  ready,
  take_off,
  go_to_waypoint,
  search_anchors,
  move_around,
  step_to_waypoint,  ///< 1/k of the way to the next one, eq 8.6
  turn,
  height_search,
  ranging,
  find_next_point,
  go_to_point,
  check_connections,
  go_back,
  hold,
  return_home,
  landing,
  done,
};
inline constexpr auto k_step_words = enum_table<Step>({{"ready", Step::ready},
                                                       {"take_off", Step::take_off},
                                                       {"go_to_waypoint", Step::go_to_waypoint},
                                                       {"search_anchors", Step::search_anchors},
                                                       {"move_around", Step::move_around},
                                                       {"step_to_waypoint", Step::step_to_waypoint},
                                                       {"turn", Step::turn},
                                                       {"height_search", Step::height_search},
                                                       {"ranging", Step::ranging},
                                                       {"find_next_point", Step::find_next_point},
                                                       {"go_to_point", Step::go_to_point},
                                                       {"check_connections", Step::check_connections},
                                                       {"go_back", Step::go_back},
                                                       {"hold", Step::hold},
                                                       {"return_home", Step::return_home},
                                                       {"landing", Step::landing},
                                                       {"done", Step::done}});
constexpr std::string_view to_string(Step step) { return k_step_words.word(step); }

/// What can happen. Times come in as `timeout`: the machine has no clock, it says when it wants to be woken.
enum class Trigger : std::uint8_t {
  start,
  airborne,
  arrived,      ///< at the target of the last go_to, heading included
  in_range,     ///< at least one unfinished anchor answers
  sampled,      ///< enough ranges of every anchor that answers
  point,        ///< the planner chose one
  no_point,     ///< the planner found none
  done_here,    ///< nothing more to gain at this waypoint, or every anchor is done
  unreachable,  ///< refused by the guard, or not approached
  connected,    ///< anchors, rover and autopilot answer at this point
  disconnected,
  landed,
  timeout,
  hold,
  resume,
  skip,
  return_home,
  land,
  taken_over,     ///< by the pilot or a failsafe: nothing is commanded any more
  not_taken_off,  ///< arming or take-off refused, or not seen to happen
};
inline constexpr auto k_trigger_words = enum_table<Trigger>({{"start", Trigger::start},
                                                             {"airborne", Trigger::airborne},
                                                             {"arrived", Trigger::arrived},
                                                             {"in_range", Trigger::in_range},
                                                             {"sampled", Trigger::sampled},
                                                             {"point", Trigger::point},
                                                             {"no_point", Trigger::no_point},
                                                             {"done_here", Trigger::done_here},
                                                             {"unreachable", Trigger::unreachable},
                                                             {"connected", Trigger::connected},
                                                             {"disconnected", Trigger::disconnected},
                                                             {"landed", Trigger::landed},
                                                             {"timeout", Trigger::timeout},
                                                             {"hold", Trigger::hold},
                                                             {"resume", Trigger::resume},
                                                             {"skip", Trigger::skip},
                                                             {"return_home", Trigger::return_home},
                                                             {"land", Trigger::land},
                                                             {"taken_over", Trigger::taken_over},
                                                             {"not_taken_off", Trigger::not_taken_off}});
constexpr std::string_view to_string(Trigger trigger) { return k_trigger_words.word(trigger); }

/// What a transition asks of the state, so that one trigger can lead to several places.
enum class Guard : std::uint8_t {
  always,
  wants_turn,        ///< an anchor is in range whose bearing is not known, and turns are allowed here
  wants_height,      ///< no turn wanted, and a height not known that a search could see
  legs_left,         ///< of the turn or the height search
  moves_left,        ///< of the three directions
  waypoint_left,     ///< there is another waypoint
  tries_left,        ///< the command may be given once more
  anything_sampled,  ///< at least one range came at this point
  was_returning,     ///< hold interrupted the way home
  had_point,         ///< hold interrupted the work at one of the planner's points
};
inline constexpr auto k_guard_words = enum_table<Guard>({{"always", Guard::always},
                                                         {"wants_turn", Guard::wants_turn},
                                                         {"wants_height", Guard::wants_height},
                                                         {"legs_left", Guard::legs_left},
                                                         {"moves_left", Guard::moves_left},
                                                         {"waypoint_left", Guard::waypoint_left},
                                                         {"tries_left", Guard::tries_left},
                                                         {"anything_sampled", Guard::anything_sampled},
                                                         {"was_returning", Guard::was_returning},
                                                         {"had_point", Guard::had_point}});
constexpr std::string_view to_string(Guard guard) { return k_guard_words.word(guard); }

struct Transition {
  Step from{};
  Trigger trigger{};
  Guard guard{};
  Step to{};
  std::string_view reason;  ///< for the operator
};
/// All transitions; of those that fit, the first wins. docs/procedure.md has the same table, where "any in
/// flight" stands for every step but ready, landing and done.
std::span<const Transition> transitions();

/// What the aircraft or the planner shall do.
struct Command {
  enum class Kind : std::uint8_t { take_off, go_to, hold, return_home, land, measure, decide };
  Kind kind{};
  Eigen::Vector3d point_m{0, 0, 0};     ///< of go_to; ENU of the plan; take_off: the height is in z
  std::optional<double> heading_rad{};  ///< clockwise from north
  bool operator==(const Command&) const = default;
};
inline constexpr auto k_command_words =
    enum_table<Command::Kind>({{"take_off", Command::Kind::take_off},
                               {"go_to", Command::Kind::go_to},
                               {"hold", Command::Kind::hold},
                               {"return_home", Command::Kind::return_home},
                               {"land", Command::Kind::land},
                               {"measure", Command::Kind::measure},
                               {"decide", Command::Kind::decide}});
constexpr std::string_view to_string(Command::Kind kind) { return k_command_words.word(kind); }

struct Waypoint {
  Eigen::Vector3d point_m{0, 0, 0};
  std::optional<double> heading_rad{};
  bool measure{true}, turn{true}, height_search{true};
  double dwell_s{4};
};

struct Settings {
  std::vector<Waypoint> waypoints;
  int k = 3;                     ///< eq 8.6
  int tries = 3;                 ///< of a command, the first included
  int points_per_waypoint = 1;   ///< the planner's points before the next waypoint is due
  double move_m = 2;             ///< of the move around
  double search_height_m = 1.5;  ///< up and down from where the search began
  double take_off_m = 4;
  double min_height_m = 1.5, max_height_m = 30;
  // Longest stay in each step, s.
  double go_to_s = 90, search_s = 5, turn_leg_s = 15, height_leg_s = 20, ranging_s = 20, decide_s = 5;
  double connections_s = 5, hold_s = 600, take_off_s = 60, landing_s = 120, return_s = 240;
  Result<void> check() const;
};

/// What a person may order of one anchor in flight.
enum class AnchorOrder : std::uint8_t {
  accept,   ///< its position is good enough: nothing more is flown for it
  give_up,  ///< it is not, and nothing more is flown for it
  reopen,   ///< takes either back
};
inline constexpr auto k_anchor_order_words = enum_table<AnchorOrder>(
    {{"accept", AnchorOrder::accept}, {"give_up", AnchorOrder::give_up}, {"reopen", AnchorOrder::reopen}});

/// One anchor's own sub-procedure; all run at once and share the aircraft.
struct AnchorTask {
  NetworkId id{};
  bool has_bearing{false}, has_height{false};
  bool no_lobe{false};  ///< the turn saw none of it, from this far: a height search would see no peak
  int iterations{};     ///< points where it was ranged
  int waiting{};        ///< points since it was ranged last: the planner serves who waits longest first
  int samples_here{};
  bool done{false};
  bool reached{false};   ///< its accuracy; done without it: a limit or a person ended it
  std::string why;       ///< why it is done, or why not yet
  std::string ended_by;  ///< the person who ended the work on it; empty: nobody did
  bool accepted{false};  ///< by that person, with the accuracy it had; else given up
  bool operator==(const AnchorTask&) const = default;
};

/// All there is to know; plain values, so that a server that was killed goes on from the stored ones.
struct State {
  Step step{Step::ready};
  Step interrupted{Step::ready};  ///< what hold interrupted
  std::size_t waypoint{};
  int tries{}, moves{}, steps{}, legs{}, points{};
  double since_s{};     ///< entered the step
  double deadline_s{};  ///< when `timeout` is due; 0: never
  Eigen::Vector3d target_m{0, 0, 0}, former_m{0, 0, 0}, centre_m{0, 0, 0};
  std::optional<double> heading_rad{};
  std::vector<Eigen::Vector3d> visited, unreachable;
  std::vector<AnchorTask> anchors;
  std::string reason;  ///< of the last transition
  /// Why the work ended, from the way home on; empty while it goes on.
  std::string ended;
  bool completed{false};  ///< it ended because nothing was left to fly
  bool by_person{false};  ///< or because a person told it to
  double flown_s{};       ///< since the start, restarts of the server included
  std::uint64_t n_transitions{};
};

/// A trigger with what comes along.
struct Input {
  Trigger trigger{};
  double now_s{};                            ///< of the flight's own clock, never falling
  std::optional<Eigen::Vector3d> point_m{};  ///< of `point`
  std::optional<double> heading_rad{};       ///< of `point`
  std::string text;                          ///< the cause, shown with the reason
};

struct Advance {
  State state;
  std::vector<Command> commands;
  const Transition* transition{};  ///< null: the trigger means nothing in this step, nothing changed
};

/// One step of Fig 8.3. Pure: no clock, no aircraft, no randomness.
Advance advance(const Settings& settings, const State& state, const Input& input);

/// A range of this anchor came. Enters it into the tasks; says whether it was unknown.
bool note_range(State& state, NetworkId anchor);
/// What each anchor should count in the planner: 0 when done, else growing with the points it waited.
double weight_of(const AnchorTask& task);

/// The state of a server that was killed: the aircraft is told to hold before anything else, and goes on when
/// the operator says so.
Advance resume_after_restart(const State& stored, double now_s);

}  // namespace anchord::procedure
