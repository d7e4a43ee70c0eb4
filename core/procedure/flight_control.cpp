#include "core/procedure/flight_control.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/angle.hpp"

namespace anchord::procedure {
namespace {

constexpr double k_steer_s = 1.0, k_tell_again_s = 3.0;
/// Of the smoothing: at rest, and under way, where a late position looks like a wrong one.
constexpr double k_rest_s = 3.0, k_moving_s = 15.0, k_moving_mps = 0.7;
constexpr double k_fresh_s = 0.6, k_just_heard_s = 0.25;
constexpr double k_most_m = 3.0;      ///< across: more is no GNSS error but a fault, and an alarm
constexpr double k_most_up_m = 30.0;  ///< a barometer drifts for as long as it flies
constexpr double k_full_cell_v = 4.25, k_cell_smooth_s = 10;

}  // namespace

FlightControl::FlightControl(FlightSetup setup, EnuFrame frame, Drone* drone)
    : frame_(std::move(frame)), drone_(drone), home_m_(setup.limits.home_m), engine_(setup) {
  if (drone_ != nullptr) drone_->new_flight(setup.limits.speed_mps);
}

FlightControl::FlightControl(FlightSetup setup, EnuFrame frame, Drone* drone, const State& stored,
                             double now_s)
    : frame_(std::move(frame)),
      drone_(drone),
      home_m_(setup.limits.home_m),
      engine_(setup, stored, now_s),
      adopts_(drone != nullptr) {
  if (drone_ == nullptr) return;
  drone_->new_flight(setup.limits.speed_mps);
  (void)engine_.take_commands();  // decided when the aircraft is heard, by its mode
}

void FlightControl::fix(double now_s, const Eigen::Vector3d& enu_m, FixClass fix) {
  engine_.fix(now_s, enu_m, fix);
  if (fix < FixClass::rtk_float) return;
  fix_m_ = enu_m;
  fix_s_ = now_s;
}

bool FlightControl::start(double now_s, const std::string& who) {
  if (drone_ != nullptr) update_vehicle(now_s, drone_->status());
  const bool started = engine_.command(now_s, Trigger::start, who);
  if (started && drone_ != nullptr && drone_->status().in_air) {
    (void)engine_.take_commands();  // it is up already
    drone_->take_back();
    engine_.command(now_s, Trigger::airborne, "");
  }
  dispatch();
  return started;
}

void FlightControl::smooth(double now_s, const Eigen::Vector3d& difference_m, double speed_mps) {
  const double passed_s = smoothed_s_ ? now_s - *smoothed_s_ : 0;
  smoothed_s_ = now_s;
  if (!shift_m_) {
    shift_m_ = difference_m;
  } else {
    const double time_s = speed_mps > k_moving_mps ? k_moving_s : k_rest_s;
    *shift_m_ += (difference_m - *shift_m_) * std::min(1.0, passed_s / time_s);
  }
  const double across_m = shift_m_->head<2>().norm();
  if (across_m > k_most_m) shift_m_->head<2>() *= k_most_m / across_m;
  shift_m_->z() = std::clamp(shift_m_->z(), -k_most_up_m, k_most_up_m);
}

void FlightControl::update_vehicle(double now_s, const DroneStatus& d) {
  if (d.autopilot.empty()) return;  // never heard
  VehicleView view;
  if (d.position && d.position_age_s < 2) {
    Eigen::Vector3d at =
        frame_.enu_from_wgs84({d.position->lat_deg, d.position->lon_deg, frame_.origin().height_m}).m;
    const bool both = fix_m_ && now_s - *fix_s_ <= k_fresh_s && d.position_age_s <= k_fresh_s;
    // Above the sea by its reckoning; what counts is how that changes from where the rover stood.
    if (!sea_level_m_) sea_level_m_ = d.position->height_m - (both ? fix_m_->z() : home_m_.z());
    at.z() = d.position->height_m - *sea_level_m_;
    autopilot_m_ = at;
    if (both) smooth(now_s, *fix_m_ - at, d.speed_mps.value_or(0));
    const Eigen::Vector3d shift = shift_m_.value_or(Eigen::Vector3d::Zero());
    view.position_m = at + Eigen::Vector3d(0, 0, shift.z());
    view.corrected_m = at + shift;
  }
  if (d.heading_deg) view.heading_rad = *d.heading_deg * k_degree;
  view.speed_mps = d.speed_mps.value_or(0);
  // Two that answer as one: that one of them stands on the ground does not end the flight of the other.
  const bool one = d.link_trouble.empty();
  view.armed = armed_ = d.armed || (armed_ && !one);
  view.in_air = in_air_ = d.in_air || (in_air_ && !one);
  if (d.battery_age_s < 10) view.battery = d.battery;
  view.battery_warning = d.battery_warning;
  if (d.battery_v) {
    if (!cells_) cells_ = std::max(1.0, std::ceil(*d.battery_v / k_full_cell_v));
    const double v = *d.battery_v / *cells_, passed_s = cell_s_ ? now_s - *cell_s_ : 0;
    cell_v_ = cell_v_ ? *cell_v_ + (v - *cell_v_) * std::min(1.0, passed_s / k_cell_smooth_s) : v;
    cell_s_ = now_s;
    view.cell_v = cell_v_;
  }
  // A heartbeat comes once a second: that much silence is none.
  engine_.vehicle(now_s - std::max(0.0, d.silent_s - 1.2), view);
}

void FlightControl::follow_link(double now_s, const DroneStatus& d) {
  if (d.taken_over && !taken_over_) {
    taken_over_ = true;
    engine_.taken_over(now_s, d.mode);
  }
  if (!d.connected) {
    silent_ = true;
    return;
  }
  // Modes of two aircraft: the first heartbeat of the other looked like a pilot's.
  if (!taken_over_) explained_ = false;
  if (taken_over_ && !d.link_trouble.empty() && !std::exchange(explained_, true))
    engine_.explain_taken_over(now_s, "nothing is commanded: " + d.link_trouble);
  const bool back = std::exchange(silent_, false);
  const auto step = engine_.state().step;
  if (adopts_) {
    adopts_ = false;
    const bool ours = d.mode_kind == ModeKind::guided || d.mode_kind == ModeKind::hold ||
                      (d.mode_kind == ModeKind::land && step == Step::landing);
    if (!ours && d.armed) {  // PX4 holds in the mode in which it is guided
      taken_over_ = true;
      engine_.taken_over(now_s, d.mode);
      return;
    }
    drone_->take_back();
  } else if (!back || taken_over_) {
    return;
  }
  if (!d.armed) return;
  // Decided anew, with what is known now.
  if (step == Step::hold && !engine_.leg())
    dispatched_.push_back({Command::Kind::hold, drone_->hold(), ""});
  else if (step == Step::landing)
    dispatched_.push_back({Command::Kind::land, drone_->land(), ""});
  else
    engine_.repeat_leg(now_s);
}

void FlightControl::round(double now_s, std::span<const Estimate> estimates, bool at_hand) {
  if (over_) return;
  if (drone_ == nullptr) {
    engine_.tick(now_s, estimates, at_hand);
    return dispatch();
  }
  const DroneStatus d = drone_->status();
  update_vehicle(now_s, d);
  follow_link(now_s, d);
  // Just behind a heartbeat: one that shows a pilot's mode must not be crossed by a command.
  const bool may = !taken_over_ && d.connected && d.mode_age_s < k_just_heard_s;
  if (repeats_ && may && (!sent_s_ || now_s - *sent_s_ > k_tell_again_s)) {
    repeats_ = false;
    sent_s_ = now_s;
    engine_.repeat_leg(now_s);
  }
  engine_.tick(now_s, estimates, at_hand);
  dispatch();
  if (engine_.state().step == Step::done) {
    over_ = true;
    drone_->end_flight();
    return;
  }
  const auto& leg = engine_.leg();
  if (!leg || taken_over_ || !d.connected || d.position_age_s > 2) return;
  if (steered_s_ && now_s - *steered_s_ < k_steer_s) return;
  steered_s_ = now_s;
  const Aim at = aim(leg->point_m, d);
  drone_->steer(at.lat_deg, at.lon_deg, at.height_m);
}

FlightControl::Aim FlightControl::aim(const Eigen::Vector3d& point_m, const DroneStatus& d) const {
  const Eigen::Vector3d shift = shift_m_.value_or(Eigen::Vector3d::Zero());
  const Wgs84 to = frame_.wgs84_from_enu(Enu{point_m - shift});
  // Higher or lower by so much than it is by now; home may be anywhere.
  const double up_m =
      autopilot_m_ ? point_m.z() - (autopilot_m_->z() + shift.z()) : point_m.z() - home_m_.z();
  return {to.lat_deg, to.lon_deg, (autopilot_m_ ? d.relative_m.value_or(0) : 0) + up_m};
}

std::uint64_t FlightControl::send(const Command& order) {
  switch (order.kind) {
    case Command::Kind::take_off:
      return take_off_ = drone_->take_off(order.point_m.z() - home_m_.z());
    case Command::Kind::go_to: {
      std::optional<double> heading;
      if (order.heading_rad) heading = std::fmod(*order.heading_rad / k_degree + 720, 360.0);
      const Aim at = aim(order.point_m, drone_->status());
      repeats_ = false;
      return last_target_ = drone_->go_to(at.lat_deg, at.lon_deg, at.height_m, heading);
    }
    case Command::Kind::hold:
      return drone_->hold();
    case Command::Kind::return_home:
      return drone_->return_home();
    case Command::Kind::land:
      return drone_->land();
    case Command::Kind::measure:
    case Command::Kind::decide:
      break;
  }
  return 0;
}

void FlightControl::dispatch() {
  for (const auto& order : engine_.take_commands()) {
    Dispatch out{order.kind, 0, ""};
    if (taken_over_)
      out.not_sent = "not sent: the pilot or a failsafe has taken over";
    else if (adopts_)
      out.not_sent = "not sent: no heartbeat of the aircraft since the restart";
    else if (drone_ != nullptr)
      out.number = send(order);
    dispatched_.push_back(std::move(out));
  }
}

std::string FlightControl::command(double now_s, Trigger trigger, const std::string& who) {
  if (adopts_ && drone_->status().connected) {  // the operator decides, before the first round could
    adopts_ = false;
    drone_->take_back();
  }
  if (taken_over_) {
    if (trigger == Trigger::skip)
      return "the pilot or a failsafe has taken over; resume, hold, return or land take it back";
    taken_over_ = false;
    drone_->take_back();
    engine_.taken_back(now_s);
  }
  const auto before = dispatched_.size();
  const bool meant = engine_.command(now_s, trigger, who);
  dispatch();
  const bool always = trigger == Trigger::hold || trigger == Trigger::land;
  if (!meant && !always) return "has no effect in step " + std::string(to_string(engine_.state().step));
  if (always && drone_ != nullptr && dispatched_.size() == before) {
    const bool holds = trigger == Trigger::hold;
    dispatched_.push_back(
        {holds ? Command::Kind::hold : Command::Kind::land, holds ? drone_->hold() : drone_->land(), ""});
  }
  return {};
}

std::uint64_t FlightControl::abort() {
  over_ = true;
  if (drone_ == nullptr) return 0;
  const auto number = drone_->hold();
  drone_->end_flight();
  return number;
}

void FlightControl::report(double now_s, const CommandReport& r) {
  if (over_ || taken_over_ || r.state == CommandState::sent || r.state == CommandState::accepted) return;
  // What became of an earlier one, of this flight or of the last, says nothing of this.
  if (r.what == "take_off" && r.number == take_off_ && engine_.state().step == Step::take_off) {
    // What is in the air has taken off, whatever became of the command: the step goes on, and its time-out
    // lands it.
    if (!in_air_) engine_.not_taken_off(now_s, r.text);
  } else if (r.what == "go_to" && r.number == last_target_) {
    if (r.state == CommandState::refused) {
      (void)engine_.command(now_s, Trigger::unreachable, "");
    } else {
      repeats_ = true;
    }
  }
}

}  // namespace anchord::procedure
