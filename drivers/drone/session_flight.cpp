// What belongs to one flight: take-off, targets, speed.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/angle.hpp"
#include "drivers/drone/commands.hpp"
#include "drivers/drone/session.hpp"

namespace anchord::drone {
namespace {

using mavlink::Message;

constexpr double k_metres_per_degree = 111'195;  // mean earth radius 6371 km
constexpr double k_reason_s = 0.8;               ///< the autopilot's words may come behind its refusal
constexpr double k_risen_m = 0.5;                ///< in the air
constexpr double k_target_again_s = 0.4;

}  // namespace

void Session::new_flight(double speed_mps) {
  end_flight();
  for (const auto& p : std::exchange(pending_, {})) {
    if (!p.part) report(p.number, p.what, CommandState::unconfirmed, "a new flight begins");
  }
  flight_ = Flight{};
  flight_->speed_mps = speed_mps;
}

void Session::end_flight() {
  if (!flight_) return;
  end_take_off(CommandState::refused, "the flight is over");
  drop_target("the flight is over");
  flight_.reset();
}

std::uint64_t Session::take_off(double above_ground_m) {
  const std::uint64_t number = ++number_;
  if (deaf(number, "take_off")) return number;
  report(number, "take_off", CommandState::sent, "");
  const auto refuse = [&](std::string text) {
    report(number, "take_off", CommandState::refused, std::move(text));
    return number;
  };
  if (!(above_ground_m > 0 && above_ground_m <= 120))
    return refuse("the height must be above 0 and at most 120 m");
  if (!flight_) return refuse("nothing is being flown");
  if (flight_->taken_over) return refuse("the pilot or a failsafe has taken over");
  if (!telemetry_.has_position(now_s_, 3)) return refuse("the autopilot does not report its position");
  if (const auto two = twins(); !two.empty()) return refuse(two);
  end_take_off(CommandState::refused, "followed by another take-off");
  TakeOff t;
  t.number = number;
  t.above_ground_m = above_ground_m;
  t.from_m = telemetry_.newest().relative_m.value_or(0);
  t.stage_s = now_s_;
  flight_->take_off = std::move(t);
  drive_take_off();
  return number;
}

/// What was armed for it and still stands there is not left with its motors running.
void Session::end_take_off(CommandState state, std::string text) {
  if (!flight_ || !flight_->take_off) return;
  const TakeOff t = *std::exchange(flight_->take_off, std::nullopt);
  std::erase_if(pending_, [&](const Pending& p) { return p.number == t.number; });
  if (state != CommandState::accepted && t.armed_here) {
    const double risen_m = telemetry_.newest().relative_m.value_or(0) - t.from_m;
    const bool stands = risen_m < k_risen_m && !(telemetry_.armed() && telemetry_.in_air(now_s_));
    if (stands) command(++number_, "disarm", k_arm, {0, 0}, true);
  }
  report(t.number, "take_off", state, std::move(text));
}

void Session::next_stage(TakeOff& t, TakeOff::Stage stage) {
  t.stage = stage;
  t.stage_s = now_s_;
  t.told = false;
  t.refused_s.reset();
}

void Session::drive_take_off() {
  if (!flight_ || !flight_->take_off) return;
  auto& t = *flight_->take_off;
  const auto& d = dialect_of(autopilot_);
  using Stage = TakeOff::Stage;
  if (t.refused_s) {
    const auto said = said_since(t.stage_s);
    if (said.empty() && now_s_ - *t.refused_s < k_reason_s) return;
    return end_take_off(CommandState::refused, t.refusal + (said.empty() ? "" : ": " + said));
  }
  if (t.stage == Stage::mode && (custom_mode_ == d.guided || d.take_off_above_sea)) next_stage(t, Stage::arm);
  if (t.stage == Stage::arm && telemetry_.armed()) next_stage(t, Stage::climb);
  const double risen_m = telemetry_.newest().relative_m.value_or(t.from_m) - t.from_m;
  if (t.stage == Stage::climb && telemetry_.has_position(now_s_, 3) && risen_m > k_risen_m) {
    if (custom_mode_ == d.guided || custom_mode_ == d.climbing)
      return end_take_off(CommandState::accepted, "in the air");
    // It flies, and its heartbeat still shows the mode in which it stood: the pilot has it back.
    if (!t.risen_s) t.risen_s = now_s_;
    if (*beat_s_ - *t.risen_s > k_mode_shows_s) return take_over();
  }
  const double patience_s = t.stage == Stage::climb ? options_.climb_s : options_.confirm_s + 0.2;
  if (now_s_ - t.stage_s > patience_s) {
    const auto said = said_since(t.stage_s);
    const char* what = t.stage == Stage::mode  ? "it does not change its mode"
                       : t.stage == Stage::arm ? "it does not arm"
                                               : "it does not climb";
    return end_take_off(CommandState::unconfirmed, what + (said.empty() ? "" : ": " + said));
  }
  if (std::exchange(t.told, true)) return;
  if (t.stage == Stage::mode) return command_mode(t.number, "mode", d.guided, true);
  if (t.stage == Stage::arm) {
    t.armed_here = true;
    return command(t.number, "arming", k_arm, {1, 0}, true);
  }
  const auto& at = telemetry_.newest();
  if (!d.take_off_above_sea)
    return command(t.number, "take-off", k_take_off, {0, 0, 0, 0, 0, 0, t.from_m + t.above_ground_m}, true);
  want(d.guided);
  flight_->passing[d.climbing] = now_s_ + 60;
  const double nan = std::nan("");
  command(t.number, "take-off", k_take_off,
          {0, 0, 0, nan, nan, nan, at.position ? at.position->height_m + t.above_ground_m : nan}, true);
}

double Session::distance_m(double lat_deg, double lon_deg, double height_m) const {
  const auto& at = telemetry_.newest();
  if (!at.position) return 0;
  const double north = (lat_deg - at.position->lat_deg) * k_metres_per_degree;
  const double east = (lon_deg - at.position->lon_deg) * k_metres_per_degree * std::cos(lat_deg * k_degree);
  return std::hypot(north, east, height_m - at.relative_m.value_or(height_m));
}

Message Session::target_message(double lat_deg, double lon_deg, double height_m,
                                std::optional<double> heading_deg) const {
  const auto as_int = [](double deg) { return static_cast<std::int64_t>(std::llround(deg * 1e7)); };
  if (dialect_of(autopilot_).targets_by_command) {
    Message m = addressed("COMMAND_INT");
    m.set("command", k_reposition).set("frame", 5).set_real("param1", flight_->speed_mps).set("param2", 1);
    m.set_real("param4", heading_deg ? *heading_deg * k_degree : std::nan(""));
    m.set("x", as_int(lat_deg)).set("y", as_int(lon_deg));
    m.set_real("z", height_m + telemetry_.home_msl_m().value_or(0));
    return m;
  }
  Message m = addressed("SET_POSITION_TARGET_GLOBAL_INT");
  // Position alone (0xDF8) or with yaw (0x9F8), frame 6: relative to home.
  m.set("type_mask", heading_deg ? 0x9F8 : 0xDF8).set("coordinate_frame", 6);
  m.set("lat_int", as_int(lat_deg)).set("lon_int", as_int(lon_deg)).set_real("alt", height_m);
  if (heading_deg) m.set_real("yaw", *heading_deg * k_degree);
  return m;
}

std::uint64_t Session::go_to(double lat_deg, double lon_deg, double height_m,
                             std::optional<double> heading_deg) {
  const std::uint64_t number = ++number_;
  report(number, "go_to", CommandState::sent, "");
  const auto refuse = [&](std::string text) {
    report(number, "go_to", CommandState::refused, std::move(text));
    return number;
  };
  // The last gate, behind the guard of the procedure.
  if (!std::isfinite(lat_deg) || !std::isfinite(lon_deg) || !std::isfinite(height_m) ||
      std::abs(lat_deg) > 90 || std::abs(lon_deg) > 180 || (lat_deg == 0 && lon_deg == 0)) {
    return refuse("the target is not a valid position");
  }
  if (!flight_) return refuse("nothing is being flown");
  if (flight_->taken_over)
    return refuse("the pilot or a failsafe has taken over: " +
                  std::string(mode_word(autopilot_, custom_mode_)));
  if (!telemetry_.has_position(now_s_, 5)) return refuse("the autopilot does not report its position");
  if (!telemetry_.armed()) return refuse("the aircraft is disarmed");
  if (const double m = distance_m(lat_deg, lon_deg, height_m); m > options_.max_jump_m) {
    return refuse("the target is " + std::to_string(std::lround(m)) + " m away");
  }
  end_take_off(CommandState::refused, "followed by a target");
  drop_target("followed by another target");
  const auto& d = dialect_of(autopilot_);
  Message m = target_message(lat_deg, lon_deg, height_m, heading_deg);
  if (d.targets_by_command) {
    // The flag to change the mode only where it must change: a pilot's may not show yet.
    if (flight_->wanted == d.guided && custom_mode_ == d.guided) m.set("param2", 0);
    want(d.guided);
    std::erase_if(pending_, [](const Pending& p) { return p.command == k_reposition; });
    send_command(m, k_reposition, number);
    pending_.push_back({number, "go_to", m, k_reposition, true, Proof::answer, 0, now_s_, now_s_, {}});
  } else if (flight_->wanted != d.guided || custom_mode_ != d.guided) {
    // After a hold, perhaps one that the heartbeat does not show yet: targets outside GUIDED are ignored in
    // silence.
    command_mode(number, "mode", d.guided, true);
  }
  flight_->target = Target{number,   std::move(m), lat_deg, lon_deg,
                           height_m, now_s_,       now_s_,  distance_m(lat_deg, lon_deg, height_m),
                           false,    false};
  if (!d.targets_by_command) send(flight_->target->message);
  return number;
}

void Session::steer(double lat_deg, double lon_deg, double height_m) {
  if (!flight_ || !flight_->target || flight_->taken_over || !telemetry_.armed()) return;
  if (!last_seen_s_ || now_s_ - *last_seen_s_ > 3) return;
  if (!std::isfinite(lat_deg) || !std::isfinite(lon_deg) || !std::isfinite(height_m) ||
      distance_m(lat_deg, lon_deg, height_m) > options_.max_jump_m)
    return;
  auto& t = *flight_->target;
  const auto& d = dialect_of(autopilot_);
  if (flight_->wanted != d.guided || custom_mode_ != d.guided) return;
  const auto yaw = t.message.real(d.targets_by_command ? "param4" : "yaw") / k_degree;
  const bool with_yaw =
      d.targets_by_command ? std::isfinite(yaw) : (t.message.integer("type_mask") & 1024) == 0;
  t.message = target_message(lat_deg, lon_deg, height_m, with_yaw ? std::optional(yaw) : std::nullopt);
  t.lat_deg = lat_deg;
  t.lon_deg = lon_deg;
  t.height_m = height_m;
  // Not the flag to change the mode: a pilot's, which does not show yet, stays.
  if (d.targets_by_command)
    send_command(t.message.set("param2", 0), k_reposition, 0);
  else
    send(t.message);
}

void Session::drop_target(const std::string& why) {
  if (!flight_ || !flight_->target) return;
  const Target t = *std::exchange(flight_->target, std::nullopt);
  std::erase_if(pending_, [&](const Pending& p) { return p.number == t.number; });
  if (!t.confirmed && !t.given_up) report(t.number, "go_to", CommandState::unconfirmed, why);
}

/// No acknowledgement exists for position targets: seen to move there, or to be there, counts. Sent again
/// until then, and after 2 s no more.
void Session::drive_target() {
  if (!flight_ || !flight_->target) return;
  auto& t = *flight_->target;
  if (t.confirmed || t.given_up) return;
  const double left_m = distance_m(t.lat_deg, t.lon_deg, t.height_m);
  const bool guided = custom_mode_ == dialect_of(autopilot_).guided;
  if (guided && flight_->reached && (left_m < 1.0 || left_m < t.from_m - 0.2)) {
    t.confirmed = true;
    return report(t.number, "go_to", CommandState::accepted, "on its way");
  }
  if (now_s_ - t.begun_s > options_.confirm_s) {
    t.given_up = true;
    return report(t.number, "go_to", CommandState::unconfirmed, "it does not move towards the target");
  }
  if (now_s_ - t.sent_s >= k_target_again_s && !dialect_of(autopilot_).targets_by_command) {
    t.sent_s = now_s_;
    send(t.message);
  }
}

/// An autopilot flies its own speed, and takes it up again whenever it changes into the mode of targets.
void Session::drive_speed() {
  if (!flight_ || flight_->taken_over || !flight_->speed_due || !(flight_->speed_mps > 0)) return;
  if (!telemetry_.armed() || !telemetry_.in_air(now_s_) || flight_->take_off) return;
  flight_->speed_due = false;
  // MAV_CMD_DO_CHANGE_SPEED: 1 ground speed, throttle unchanged.
  command(++number_, "speed", k_speed, {1, flight_->speed_mps, -1}, true);
}

}  // namespace anchord::drone
