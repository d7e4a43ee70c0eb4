#include "core/procedure/flight_engine.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/base/angle.hpp"
#include "core/planning/local_plan.hpp"
#include "core/planning/route.hpp"

namespace anchord::procedure {
namespace {

constexpr double k_listen_s = 1.0;           ///< least stay in a search, so that every anchor had its turn
constexpr double k_connect_s = 1.0;          ///< least look at the connections of a point
constexpr double k_settle_s = 0.5;           ///< at rest this long counts as arrived
constexpr double k_slowest_climb_mps = 1.0;  ///< of an autopilot that takes off
constexpr int k_in_range = 3;                ///< ranges that make an anchor heard
constexpr double k_late_s = 0.5;             ///< latency and period of telemetry on a poor link
constexpr double k_latest_s =
    1.0;  ///< of two positions that are compared; older ones are an alarm of their own

double apart(double a, double b) { return std::abs(std::remainder(a - b, 2 * std::numbers::pi)); }

bool in_flight(Step step) { return step != Step::ready && step != Step::done; }

}  // namespace

Result<FlightSetup> flight_setup(const Plan& plan, const Eigen::Vector3d& home_m) {
  BOOST_OUTCOME_TRY(const auto local, planning::local_plan(plan));
  const PlanSettings& s = plan.settings;
  FlightSetup out;
  out.origin = local.origin;
  out.expected = plan.expected_anchors;
  out.samples = s.samples;
  const auto& corners = local.outline.empty() ? local.fence : local.outline;
  for (const auto& corner : corners) {
    out.middle_m.head<2>() += corner / static_cast<double>(corners.size());
  }
  out.middle_m.z() = plan.building_height_m / 2;
  for (std::size_t i = 0; i < plan.waypoints.size(); ++i) {
    const auto& w = plan.waypoints[i];
    const Eigen::Vector2d look = (out.middle_m - local.waypoints_m[i]).head<2>();
    out.settings.waypoints.push_back(
        {local.waypoints_m[i], w.heading_deg ? *w.heading_deg * k_degree : std::atan2(look.x(), look.y()),
         w.measure, w.turn, w.height_search, w.dwell_s.value_or(s.dwell_s)});
  }
  out.settings.k = s.k;
  out.settings.ranging_s = s.dwell_s + 2;
  out.settings.min_height_m = s.min_height_m;
  out.settings.max_height_m = s.max_height_m;
  out.settings.take_off_m = std::clamp(4.0, s.min_height_m, s.max_height_m);
  const double climb_m = std::max(out.settings.take_off_m, s.min_height_m - home_m.z());
  out.settings.take_off_s += std::max(0.0, climb_m) / k_slowest_climb_mps;
  BOOST_OUTCOME_TRY(out.settings.check());
  out.limits.bounds = planning::flight_bounds(local, s);
  out.walls = local.walls;
  out.limits.home_m = home_m;
  out.limits.speed_mps = s.speed_mps;
  out.limits.min_battery = s.min_battery;
  out.limits.battery_per_s = 1 / s.endurance_s;
  out.exit.min_iterations = s.min_iterations;
  out.exit.max_iterations = s.max_iterations;
  out.exit.target_sigma_m = s.target_sigma_m;
  out.anchor_target_sigma_m = plan.anchor_target_sigma_m;
  out.exit.gdop_root = s.target_gdop;
  out.exit.max_s = s.max_flight_s;
  out.exit.min_battery = s.min_battery;
  auto& p = out.planner;
  p.rule = s.rule;
  p.combine = s.combine;
  p.grid = {s.grid_step_m, s.grid_step_up_m, s.grid_reach, s.grid_reach_up};
  p.bias_column = p.rule != planning::Rule::dissertation;
  p.flight_time_cost = p.rule != planning::Rule::dissertation;
  p.speed_mps = s.speed_mps;
  p.dwell_s = s.dwell_s;
  return out;
}

ExitRule FlightSetup::exit_rule(NetworkId anchor) const {
  ExitRule out = exit;
  if (const auto own = anchor_target_sigma_m.find(anchor); own != anchor_target_sigma_m.end())
    out.target_sigma_m = own->second;
  return out;
}

double take_off_height_m(const FlightSetup& setup) {
  return std::max(setup.limits.home_m.z() + setup.settings.take_off_m, setup.settings.min_height_m);
}

FlightEngine::FlightEngine(FlightSetup setup) : setup_(std::move(setup)), priors_(setup_.middle_m.z()) {}

FlightEngine::FlightEngine(FlightSetup setup, const State& stored, double now_s)
    : FlightEngine(std::move(setup)) {
  state_ = stored;
  started_s_ = now_s - stored.flown_s;
  watched_s_ = now_s;
  apply(now_s, resume_after_restart(stored, now_s));
}

std::optional<Eigen::Vector3d> FlightEngine::position_m() const {
  return fix_m_ ? fix_m_ : vehicle_.position_m;
}
double FlightEngine::elapsed_s() const { return started_s_ ? state_.since_s - *started_s_ : 0; }

std::vector<Command> FlightEngine::take_commands() { return std::exchange(orders_, {}); }
std::vector<Event> FlightEngine::take_events() { return std::exchange(events_, {}); }

void FlightEngine::report(double now_s, EventLevel level, std::string code, std::string text,
                          std::optional<Eigen::Vector3d> place_m) {
  events_.push_back({now_s, level, std::move(code), std::move(text), place_m});
}

void FlightEngine::fix(double now_s, const Eigen::Vector3d& enu_m, FixClass fix) {
  fix_ = fix;
  if (fix >= FixClass::rtk_float) good_fix_s_ = now_s;
  if (fix == FixClass::none) return;
  fix_m_ = enu_m;
  fix_s_ = now_s;
}

void FlightEngine::range(double now_s, NetworkId anchor, bool used, std::optional<double> rss_dbm,
                         std::optional<double> distance_m) {
  if (!in_flight(state_.step)) return;
  const auto at = position_m();
  if (distance_m && at) {
    priors_.ranged(anchor, *at, *distance_m);
    distance_m_[anchor] = *distance_m;
    near_enough(anchor, *distance_m);
  }
  if (rss_dbm && state_.step == Step::turn && vehicle_.heading_rad)
    priors_.turned(anchor, *vehicle_.heading_rad, *rss_dbm);
  if (rss_dbm && state_.step == Step::height_search && at) priors_.climbed(anchor, at->z(), *rss_dbm);
  if (!used) return;
  if (note_range(state_, anchor))
    report(now_s, EventLevel::info, "anchor.found",
           "anchor " + to_string(anchor) + " in range for the first time");
}

void FlightEngine::vehicle(double now_s, const VehicleView& view) {
  vehicle_ = view;
  vehicle_s_ = now_s;
  if (view.position_m) vehicle_m_s_ = now_s;
  was_armed_ |= view.armed;
}

void FlightEngine::order(const Command& command) {
  orders_.push_back(command);
  leg_ = command.kind == Command::Kind::go_to ? std::optional(command) : std::nullopt;
}

void FlightEngine::taken_over(double now_s, const std::string& mode) {
  taken_over_ = true;
  leg_.reset();
  legs_.clear();
  pending_.reset();
  feed(now_s, Trigger::taken_over, mode);
  report(now_s, EventLevel::warning, "drone.taken_over", "the pilot or a failsafe has taken over: " + mode);
}

void FlightEngine::explain_taken_over(double now_s, const std::string& why) {
  state_.reason = why;
  report(now_s, EventLevel::critical, "drone.taken_over", why);
}

/// What is wrong is judged anew: it was only told of before.
void FlightEngine::taken_back(double now_s) {
  taken_over_ = false;
  alarm_.reset();
  if (state_.deadline_s > 0) state_.deadline_s = std::max(state_.deadline_s, now_s + 10);
}

void FlightEngine::repeat_leg(double now_s) {
  if (!legs_.empty()) return next_leg(now_s);
  if (state_.step == Step::return_home) execute(now_s, {Command::Kind::return_home, {0, 0, 0}, std::nullopt});
}

std::optional<double> FlightEngine::distance_left_m() const {
  const auto at = position_m();
  if (!at || !leg_) return std::nullopt;
  return (*at - (legs_.empty() ? leg_->point_m : legs_.back())).norm();
}

/// Straight up to the lower end of the band, where it is: what comes down by itself does not stop by a hold.
void FlightEngine::climb(double now_s) {
  constexpr double k_again_s = 3, k_above_floor_m = 0.5;
  if (!fix_m_ || (climb_s_ && now_s - *climb_s_ < k_again_s)) return;
  climb_s_ = now_s;
  Command up{Command::Kind::go_to, *fix_m_, std::nullopt};
  const double floor_m = setup_.limits.bounds.min_height_m.value_or(setup_.settings.min_height_m);
  up.point_m.z() = std::max(floor_m, setup_.settings.min_height_m) + k_above_floor_m;
  if (refuse_command(setup_.limits, fix_m_, up)) return;  // straight up is not allowed here: it holds
  orders_.clear();
  order(up);
}

/// On the ground and disarmed for a while, whoever did it; before it was armed that is where a flight begins.
bool FlightEngine::down(double now_s) {
  constexpr double k_sure_s = 2;
  const bool now_down = vehicle_s_ && now_s - *vehicle_s_ < 3 && !vehicle_.in_air && !vehicle_.armed &&
                        (was_armed_ || state_.step != Step::take_off);
  if (!now_down) down_s_.reset();
  if (now_down && !down_s_) down_s_ = now_s;
  return now_down && now_s - *down_s_ >= k_sure_s;
}

bool FlightEngine::command(double now_s, Trigger trigger, const std::string& who) {
  if (trigger == Trigger::start) started_s_ = watched_s_ = now_s;
  const bool went_on = state_.ended.empty();
  if (!feed(now_s, trigger, who.empty() ? std::string{} : "by " + who)) return false;
  if (went_on && !state_.ended.empty()) state_.by_person = true;
  return true;
}

/// From where a turn saw no lobe of an anchor a height search, which needs one, sees nothing either.
void FlightEngine::note_lobes() {
  for (auto& task : state_.anchors) {
    const auto seen = task.samples_here > 0 ? priors_.lobe_seen(task.id) : std::nullopt;
    if (!seen) continue;
    task.no_lobe = !*seen;
    if (const auto at = distance_m_.find(task.id); task.no_lobe && at != distance_m_.end())
      no_lobe_m_[task.id] = at->second;
  }
}

void FlightEngine::near_enough(NetworkId anchor, double distance_m) {
  constexpr double k_nearer = 0.7;
  const auto from = no_lobe_m_.find(anchor);
  if (from == no_lobe_m_.end() || distance_m > k_nearer * from->second) return;
  for (auto& task : state_.anchors) task.no_lobe = task.no_lobe && task.id != anchor;
  no_lobe_m_.erase(from);
}

bool FlightEngine::feed(double now_s, Trigger trigger, std::string text, std::optional<Eigen::Vector3d> point,
                        std::optional<double> heading) {
  if (state_.step == Step::turn && trigger == Trigger::arrived && state_.legs <= 1) note_lobes();
  const auto step = advance(setup_.settings, state_, {trigger, now_s, point, heading, std::move(text)});
  if (step.transition == nullptr) return false;
  apply(now_s, step);
  return true;
}

void FlightEngine::apply(double now_s, const Advance& step) {
  const bool measured = step.state.visited.size() > state_.visited.size();
  if (const auto from = state_.step, to = step.state.step; from != to) {
    if (from == Step::turn) priors_.conclude_turn();
    if (from == Step::height_search) priors_.conclude_height_search();
    if (to == Step::turn) priors_.begin_turn();
    if (to == Step::height_search) priors_.begin_height_search();
  }
  state_ = step.state;
  if (started_s_) state_.flown_s = now_s - *started_s_;
  if (state_.step == Step::done) leg_.reset();
  if (measured) {
    for (const auto& a : state_.anchors) {
      if (a.samples_here > 0) measured_at_[a.id].push_back(state_.visited.back());
    }
  }
  legs_.clear();
  settled_s_.reset();
  pending_.reset();
  point_task_.reset();
  asked_.reset();
  answer_.reset();
  const auto sent = std::ranges::find(step.commands, Command::Kind::go_to, &Command::kind);
  report(now_s, EventLevel::info, "procedure." + std::string(to_string(state_.step)), state_.reason,
         sent == step.commands.end() ? std::nullopt : std::optional(sent->point_m));
  for (const auto& c : step.commands) execute(now_s, c);
}

void FlightEngine::execute(double now_s, const Command& c) {
  switch (c.kind) {
    case Command::Kind::take_off: {
      if (vehicle_.in_air) return;  // it climbs already: an autopilot refuses a second take-off
      Command up = c;
      up.point_m.z() = climb_to_m_ = take_off_height_m(setup_);
      if (const auto refused = refuse_command(setup_.limits, position_m(), up)) {
        report(now_s, EventLevel::critical, "cmd.refused", refused->text);
        pending_ = vehicle_.armed || vehicle_.in_air ? Trigger::land : Trigger::not_taken_off;
        pending_text_ = refused->text;
      } else {
        order(up);
      }
      return;
    }
    case Command::Kind::go_to:
      return fly(now_s, c.point_m, c.heading_rad, false);
    case Command::Kind::return_home: {
      Eigen::Vector3d above = setup_.limits.home_m;
      above.z() = std::clamp(above.z() + setup_.settings.take_off_m, setup_.settings.min_height_m,
                             setup_.settings.max_height_m);
      return fly(now_s, above, std::nullopt, true);
    }
    case Command::Kind::hold:
    case Command::Kind::land:
      return order(c);
    case Command::Kind::measure:
    case Command::Kind::decide:
      return;  // the engine's own work, seen by the step
  }
}

/// Lays out the legs. The way home without a legal route, or without a position, is the autopilot's own
/// return.
void FlightEngine::fly(double now_s, const Eigen::Vector3d& to_m, std::optional<double> heading, bool home) {
  const auto from = position_m();
  const bool lost = alarm_ && (alarm_->id == "rtk.lost" || alarm_->id == "drone.link");
  const auto way =
      from && !(home && lost) ? planning::route(setup_.limits.bounds, *from, to_m) : std::nullopt;
  if (!way && home) return order({Command::Kind::return_home, {0, 0, 0}, std::nullopt});
  if (!way) {
    report(now_s, EventLevel::warning, "point.unreachable", "no permitted path to the target");
    pending_ = Trigger::unreachable;
    pending_text_ = "no permitted path";
    return;
  }
  legs_.assign(way->begin(), way->end());
  if (!home) state_.heading_rad = heading ? heading : state_.heading_rad;
  next_leg(now_s);
}

void FlightEngine::next_leg(double now_s) {
  settled_s_.reset();
  const auto heading = state_.step == Step::return_home ? std::nullopt : state_.heading_rad;
  Command c{Command::Kind::go_to, legs_.front(), heading};
  const auto at = position_m();
  auto refused = refuse_command(setup_.limits, at, c);
  // A turning point counts as reached from a metre off, and from there the next leg may graze what it clears.
  const auto anew = refused && at ? planning::route(setup_.limits.bounds, *at, legs_.back()) : std::nullopt;
  if (anew) {
    legs_.assign(anew->begin(), anew->end());
    c.point_m = legs_.front();
    refused = refuse_command(setup_.limits, at, c);
  }
  if (refused) {
    report(now_s, EventLevel::warning, "point.unreachable", refused->text);
    legs_.clear();
    pending_ = Trigger::unreachable;
    pending_text_ = refused->text;
    return;
  }
  order(c);
}

void FlightEngine::monitor(double now_s) {
  Situation now;
  now.position_m = position_m();
  const auto age = [&](const std::optional<double>& t) {
    return now_s - t.value_or(watched_s_.value_or(now_s));
  };
  now.position_age_s = fix_m_ ? age(fix_s_) : age(vehicle_s_);
  now.autopilot_m = vehicle_.position_m;
  if (vehicle_m_s_ && !vehicle_.position_m) now.autopilot_m_age_s = now_s - *vehicle_m_s_;
  now.fix = fix_;
  now.since_good_fix_s = age(good_fix_s_);
  now.autopilot_silent_s = age(vehicle_s_);
  now.battery = vehicle_.battery;
  now.battery_warning = vehicle_.battery_warning;
  now.cell_v = vehicle_.cell_v;
  now.flying = in_flight(state_.step) && (vehicle_.in_air || state_.step != Step::take_off);
  // The height of a fix without RTK is off by metres: nothing is flown by it.
  const bool height_known = fix_m_ && now.since_good_fix_s <= setup_.limits.position_age_s;
  if (height_known && fix_m_->z() >= setup_.settings.min_height_m) above_floor_ = true;
  now.floor = above_floor_ && height_known && vehicle_.in_air && state_.step != Step::take_off &&
              state_.step != Step::landing && !lands_by_itself();
  SafetyLimits limits = setup_.limits;
  // What disagrees agrees again when it does so clearly.
  if (alarm_ && alarm_->id == "position.disagree") limits.disagree_m *= 2.0 / 3;
  // Under way the two are of different moments: the way flown between them is no disagreement.
  limits.disagree_m +=
      vehicle_.speed_mps * std::min(k_late_s + now.position_age_s + now.autopilot_silent_s, k_latest_s);
  auto alarm = watch(limits, now);
  // A position that is not known any more agrees with nothing.
  if (!alarm && alarm_ && alarm_->id == "position.disagree" && !now.autopilot_m) alarm = alarm_;
  if (alarm && alarm->climbs) alarm->text += taken_over_ ? ": climb" : ": climbing";
  if (taken_over_) {
    if (alarm && (!alarm_ || alarm_->id != alarm->id))
      report(now_s, EventLevel::critical, alarm->id, alarm->text);
    alarm_ = alarm;
    return;
  }
  if (alarm && alarm->climbs && alarm_ && alarm_->climbs) climb(now_s);
  if (alarm && (!alarm_ || alarm_->id != alarm->id || alarm_->reaction < alarm->reaction)) {
    report(now_s, EventLevel::critical, alarm->id, alarm->text);
    alarm_ = alarm;
    const auto step = state_.step;
    if (alarm->climbs) {
      if (step != Step::hold) feed(now_s, Trigger::hold, alarm->text);
      climb_s_.reset();
      return climb(now_s);
    }
    if (alarm->reaction == Reaction::land && step != Step::landing) {
      feed(now_s, Trigger::land, alarm->text);
    } else if (alarm->reaction == Reaction::return_home && step != Step::landing &&
               step != Step::return_home) {
      feed(now_s, Trigger::return_home, alarm->text);
    } else if (alarm->reaction == Reaction::hold && step != Step::landing && step != Step::hold &&
               step != Step::return_home) {
      feed(now_s, Trigger::hold, alarm->text);
    }
    return;
  }
  if (!alarm && alarm_) report(now_s, EventLevel::info, alarm_->id + ".cleared", "no longer");
  alarm_ = alarm;
}

/// The autopilot's own return ends with its landing, which the server does not command: near home it may come
/// down.
bool FlightEngine::lands_by_itself() const {
  constexpr double k_near_home_m = 5;
  const auto at = position_m();
  return state_.step == Step::return_home && legs_.empty() && at &&
         (*at - setup_.limits.home_m).head<2>().norm() < k_near_home_m;
}

void FlightEngine::detect_arrival(double now_s) {
  if (legs_.empty()) return;
  const auto at = position_m();
  if (!at) return;
  const bool last = legs_.size() == 1, home = state_.step == Step::return_home;
  const double within_m = home ? setup_.home_arrive_m : last ? setup_.arrive_m : 2 * setup_.arrive_m;
  const auto& believed = vehicle_.corrected_m;
  const bool near = (*at - legs_.front()).norm() <= within_m &&
                    (!believed || (*believed - legs_.front()).norm() <= setup_.arrive_believed_m + within_m);
  const bool turned = !last || !state_.heading_rad || !vehicle_.heading_rad || home ||
                      apart(*state_.heading_rad, *vehicle_.heading_rad) <= setup_.arrive_rad;
  const bool still = !last || vehicle_.speed_mps <= (home ? setup_.home_arrive_mps : setup_.arrive_mps);
  if (!near || !turned || !still) {
    settled_s_.reset();
    return;
  }
  if (!settled_s_) settled_s_ = now_s;
  if (last && now_s - *settled_s_ < k_settle_s) return;
  legs_.pop_front();
  if (legs_.empty())
    feed(now_s, Trigger::arrived);
  else
    next_leg(now_s);
}

void FlightEngine::work(double now_s, std::span<const Estimate> estimates, bool at_hand) {
  const double here_s = now_s - state_.since_s;
  const auto heard = [&](int n) {
    return std::any_of(state_.anchors.begin(), state_.anchors.end(),
                       [n](const AnchorTask& a) { return !a.done && a.samples_here >= n; });
  };
  switch (state_.step) {
    case Step::take_off: {
      const auto at = vehicle_.position_m ? vehicle_.position_m : fix_m_;
      const double home_m = setup_.limits.home_m.z();
      if (vehicle_.in_air && at && at->z() - home_m >= 0.9 * (climb_to_m_ - home_m))
        feed(now_s, Trigger::airborne);
      return;
    }
    case Step::search_anchors: {
      const auto& waypoint = setup_.settings.waypoints.at(state_.waypoint);
      if (state_.steps == 0 && !waypoint.measure) {
        feed(now_s, Trigger::done_here, "a waypoint without measurement");
      } else if (here_s >= k_listen_s && heard(k_in_range)) {
        feed(now_s, Trigger::in_range);
      } else if (here_s >= 2 * k_listen_s &&
                 std::any_of(state_.anchors.begin(), state_.anchors.end(),
                             [](const AnchorTask& a) { return a.samples_here >= k_in_range; })) {
        feed(now_s, Trigger::done_here, "only anchors that are done are in range here");
      }
      return;
    }
    case Step::check_connections:
      if (here_s >= k_connect_s && heard(1) && (fix_ >= FixClass::rtk_float)) feed(now_s, Trigger::connected);
      return;
    case Step::ranging: {
      const double dwell_s = setup_.settings.waypoints.at(state_.waypoint).dwell_s;
      const bool enough = std::all_of(state_.anchors.begin(), state_.anchors.end(), [&](const AnchorTask& a) {
        return a.done || a.samples_here == 0 || a.samples_here >= setup_.samples;
      });
      if (here_s >= dwell_s && enough && heard(1)) feed(now_s, Trigger::sampled);
      return;
    }
    case Step::find_next_point:
      if (answer_)
        conclude(now_s, *std::exchange(answer_, std::nullopt));
      else if (!asked_ && at_hand)
        decide(now_s, estimates);
      return;
    case Step::return_home:
    case Step::landing:
    case Step::ready:
    case Step::go_to_waypoint:
    case Step::move_around:
    case Step::step_to_waypoint:
    case Step::turn:
    case Step::height_search:
    case Step::go_to_point:
    case Step::go_back:
    case Step::hold:
    case Step::done:
      return;
  }
}

/// The longest flight is over: home at once, from whatever step. Who holds, holds; it is over when he
/// resumes.
bool FlightEngine::end_of_time(double now_s, std::span<const Estimate> estimates) {
  const auto& longest_s = setup_.exit.max_s;
  const auto step = state_.step;
  if (!longest_s || !started_s_ || now_s - *started_s_ < *longest_s || step == Step::take_off ||
      step == Step::hold || step == Step::return_home || step == Step::landing)
    return false;
  assess_anchors(now_s, estimates);
  const std::string why = "the flight time of " + std::to_string(std::lround(*longest_s)) + " s is over";
  report(now_s, EventLevel::warning, "procedure.time_over", why);
  return feed(now_s, Trigger::return_home, why);
}

void FlightEngine::tick(double now_s, std::span<const Estimate> estimates, bool at_hand) {
  if (!in_flight(state_.step)) return;
  if (down(now_s) && feed(now_s, Trigger::landed)) return;
  monitor(now_s);
  if (taken_over_) return;
  if (end_of_time(now_s, estimates)) return;
  if (pending_) {
    const auto trigger = *std::exchange(pending_, std::nullopt);
    if (feed(now_s, trigger, std::exchange(pending_text_, {}))) return;
  }
  detect_arrival(now_s);
  work(now_s, estimates, at_hand);
  if (state_.deadline_s > 0 && now_s >= state_.deadline_s) {
    if (state_.step == Step::ranging || state_.step == Step::search_anchors) assess_anchors(now_s, estimates);
    feed(now_s, Trigger::timeout);
  }
}

}  // namespace anchord::procedure
