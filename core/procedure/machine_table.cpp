#include <array>

#include "core/procedure/machine.hpp"

namespace anchord::procedure {
namespace {

using S = Step;
using E = Trigger;
using G = Guard;

// In the order in which they are tried. docs/procedure.md has the same rows; machine_test.cpp compares them.
constexpr Transition k_table[] = {
    {S::ready, E::start, G::always, S::take_off, "started by the operator"},

    {S::take_off, E::airborne, G::always, S::go_to_waypoint, "in the air, to the first waypoint"},
    {S::take_off, E::not_taken_off, G::always, S::done, "did not take off"},
    {S::take_off, E::timeout, G::tries_left, S::take_off, "take-off not confirmed, commanded again"},
    {S::take_off, E::timeout, G::always, S::landing, "take-off not confirmed, giving up"},

    {S::go_to_waypoint, E::arrived, G::always, S::search_anchors, "waypoint reached, listening"},
    {S::go_to_waypoint, E::timeout, G::tries_left, S::go_to_waypoint,
     "waypoint not reached in time, commanded again"},
    {S::go_to_waypoint, E::timeout, G::waypoint_left, S::go_to_waypoint, "waypoint not reached, to the next"},
    {S::go_to_waypoint, E::timeout, G::always, S::return_home, "last waypoint not reached"},
    {S::go_to_waypoint, E::unreachable, G::waypoint_left, S::go_to_waypoint,
     "waypoint not allowed, to the next"},
    {S::go_to_waypoint, E::unreachable, G::always, S::return_home, "last waypoint not allowed"},

    {S::search_anchors, E::in_range, G::wants_turn, S::turn, "anchor in range, its bearing is needed"},
    {S::search_anchors, E::in_range, G::wants_height, S::height_search,
     "anchor in range, its height is needed"},
    {S::search_anchors, E::in_range, G::always, S::ranging, "anchors in range, ranging"},
    {S::search_anchors, E::done_here, G::waypoint_left, S::go_to_waypoint,
     "nothing to measure here, to the next waypoint"},
    {S::search_anchors, E::done_here, G::always, S::return_home, "all waypoints flown"},
    {S::search_anchors, E::timeout, G::moves_left, S::move_around, "no anchor in range, moving around"},
    {S::search_anchors, E::timeout, G::waypoint_left, S::step_to_waypoint,
     "still no anchor, a step towards the next waypoint"},
    {S::search_anchors, E::timeout, G::always, S::return_home, "no anchor at the last waypoint"},

    {S::move_around, E::arrived, G::always, S::search_anchors, "moved, listening again"},
    {S::move_around, E::unreachable, G::always, S::search_anchors,
     "that direction is blocked, listening again"},
    {S::move_around, E::timeout, G::always, S::search_anchors, "move not finished, listening again"},

    {S::step_to_waypoint, E::arrived, G::always, S::search_anchors, "a step further, listening again"},
    {S::step_to_waypoint, E::unreachable, G::waypoint_left, S::go_to_waypoint,
     "the step is blocked, to the next waypoint"},
    {S::step_to_waypoint, E::unreachable, G::always, S::return_home, "the step is blocked, no waypoint left"},
    {S::step_to_waypoint, E::timeout, G::waypoint_left, S::go_to_waypoint,
     "the step took too long, to the next waypoint"},
    {S::step_to_waypoint, E::timeout, G::always, S::return_home, "the step took too long, no waypoint left"},

    {S::turn, E::arrived, G::legs_left, S::turn, "a quarter of the turn done"},
    {S::turn, E::arrived, G::wants_height, S::height_search, "turned, now the height"},
    {S::turn, E::arrived, G::always, S::ranging, "turned, ranging"},
    {S::turn, E::unreachable, G::always, S::ranging, "no turn here, ranging"},
    {S::turn, E::timeout, G::always, S::ranging, "turn not finished, ranging"},

    {S::height_search, E::arrived, G::legs_left, S::height_search, "a leg of the height search done"},
    {S::height_search, E::arrived, G::always, S::ranging, "heights searched, ranging"},
    {S::height_search, E::unreachable, G::legs_left, S::height_search,
     "that height is blocked, to the next height"},
    {S::height_search, E::unreachable, G::always, S::ranging, "that height is blocked, ranging"},
    {S::height_search, E::timeout, G::always, S::ranging, "height search not finished, ranging"},

    {S::ranging, E::sampled, G::always, S::find_next_point, "enough ranges at this point"},
    {S::ranging, E::timeout, G::anything_sampled, S::find_next_point, "time at this point is over"},
    {S::ranging, E::timeout, G::always, S::search_anchors, "no anchor answers any more, listening again"},

    {S::find_next_point, E::point, G::always, S::go_to_point, "better point found"},
    {S::find_next_point, E::done_here, G::waypoint_left, S::go_to_waypoint,
     "enough measured here, to the next waypoint"},
    {S::find_next_point, E::done_here, G::always, S::return_home,
     "nothing more to gain at the last waypoint"},
    {S::find_next_point, E::no_point, G::waypoint_left, S::go_to_waypoint,
     "no better point from here, to the next waypoint"},
    {S::find_next_point, E::no_point, G::always, S::return_home, "no better point and no waypoint left"},
    {S::find_next_point, E::timeout, G::waypoint_left, S::go_to_waypoint,
     "no decision in time, to the next waypoint"},
    {S::find_next_point, E::timeout, G::always, S::return_home, "no decision in time and no waypoint left"},

    {S::go_to_point, E::arrived, G::always, S::check_connections, "point reached"},
    {S::go_to_point, E::unreachable, G::always, S::go_back, "point not reachable, noted"},
    {S::go_to_point, E::timeout, G::always, S::go_back, "point not reached in time, noted"},

    {S::check_connections, E::connected, G::wants_turn, S::turn, "new anchor here, its bearing is needed"},
    {S::check_connections, E::connected, G::always, S::ranging, "all anchors connected, ranging"},
    {S::check_connections, E::disconnected, G::always, S::go_back, "no connection at this point, noted"},
    {S::check_connections, E::timeout, G::always, S::go_back, "no connection at this point in time, noted"},

    {S::go_back, E::arrived, G::always, S::find_next_point, "back at the previous point"},
    {S::go_back, E::unreachable, G::always, S::find_next_point,
     "the way back is blocked, deciding from here"},
    {S::go_back, E::timeout, G::always, S::find_next_point, "not back in time, deciding from here"},

    {S::hold, E::resume, G::was_returning, S::return_home, "resumed, on the way home"},
    {S::hold, E::resume, G::had_point, S::go_to_point, "resumed, back to the point"},
    {S::hold, E::resume, G::always, S::go_to_waypoint, "resumed, to the waypoint"},
    {S::hold, E::timeout, G::always, S::return_home, "held too long"},

    {S::return_home, E::arrived, G::always, S::landing, "above home, landing"},
    {S::return_home, E::timeout, G::tries_left, S::return_home, "not home in time, commanded again"},
    {S::return_home, E::timeout, G::always, S::landing, "not home in time, landing"},
    {S::return_home, E::landed, G::always, S::done, "landed"},

    {S::landing, E::landed, G::always, S::done, "landed"},
    {S::landing, E::timeout, G::always, S::landing, "still in the air, commanded to land again"},
};

}  // namespace

std::span<const Transition> transitions() {
  static const std::vector<Transition> all = [] {
    std::vector<Transition> out(std::begin(k_table), std::end(k_table));
    for (const auto& [word, from] : k_step_words) {
      if (from == S::ready || from == S::landing || from == S::done) continue;
      if (from != S::hold) out.push_back({from, E::hold, G::always, S::hold, "commanded to hold"});
      out.push_back({from, E::skip, G::waypoint_left, S::go_to_waypoint, "waypoint skipped, to the next"});
      out.push_back({from, E::skip, G::always, S::return_home, "last waypoint skipped"});
      if (from != S::return_home)
        out.push_back({from, E::return_home, G::always, S::return_home, "commanded to return"});
      out.push_back({from, E::land, G::always, S::landing, "commanded to land"});
      if (from != S::hold)
        out.push_back({from, E::taken_over, G::always, S::hold, "the pilot or a failsafe has taken over"});
      if (from != S::return_home)
        out.push_back({from, E::landed, G::always, S::done, "landed and disarmed without a command"});
    }
    out.push_back({S::landing, E::taken_over, G::always, S::hold, "the pilot or a failsafe has taken over"});
    out.push_back({S::landing, E::hold, G::always, S::hold, "landing stopped, commanded to hold"});
    return out;
  }();
  return all;
}

}  // namespace anchord::procedure
