// Bytes, heartbeats, and whose mode it is.
#include "drivers/drone/session.hpp"

#include <algorithm>
#include <utility>

#include "drivers/drone/vehicle_kind.hpp"

namespace anchord::drone {
namespace {

using mavlink::Message;

constexpr double k_vehicle_kept_s = 10, k_silent_s = 3;
constexpr double k_mode_kept_s =
    5;  ///< other messages show that the link lives; whose mode it is they do not
/// Of ours. ArduPilot's failsafe waits for 5 s by default (FS_GCS_TIMEOUT): of one heartbeat a second and a
/// link that loses every third, five in a row are lost every few minutes; of twenty, never.
constexpr double k_heartbeat_s = 0.25;

}  // namespace

Session::Session(SessionOptions options) : options_(options), packer_(options.self) {
  if (options_.secret) {
    packer_.sign_with(*options_.secret, 0, 0);
    framer_.require_signature(*options_.secret, 0);
  }
}

void Session::send(const Message& message) {
  const auto bytes = packer_.pack(message);
  out_.insert(out_.end(), bytes.begin(), bytes.end());
}

std::vector<std::uint8_t> Session::take_bytes() { return std::exchange(out_, {}); }
std::vector<CommandReport> Session::take_reports() { return std::exchange(reports_, {}); }

void Session::report(std::uint64_t number, const std::string& what, CommandState state, std::string text) {
  reports_.push_back({number, what, state, std::move(text)});
}

Message Session::addressed(std::string_view name) const {
  Message m(name);
  m.set("target_system", vehicle_.system).set("target_component", vehicle_.component);
  return m;
}

void Session::feed(double now_s, std::int64_t unix_us, std::span<const std::uint8_t> bytes) {
  now_s_ = now_s;
  framer_.set_time(mavlink::signature_time(unix_us));
  std::vector<mavlink::Received> in;
  framer_.feed(bytes, in);
  packer_.set_time(framer_.newest_signature());  // the autopilot refuses stamps behind its own
  for (const auto& one : in) handle(one);
}

/// Nothing of one aircraft is another's.
void Session::forget_vehicle() {
  last_seen_s_.reset();
  beat_s_.reset();
  vehicle_ = {0, 0};
  expected_.reset();
  autopilot_ = Autopilot::unknown;
  custom_mode_ = 0;
  flight_.reset();
  pending_.clear();
  sent_.clear();
  telemetry_ = Telemetry();
  lists_lost("another aircraft is on the link since");
  for (const auto& [list, up] : std::exchange(waiting_, {}))
    report(up.number, "upload", CommandState::unconfirmed, "another aircraft is on the link now");
  if (transfer_) {
    transfer_->check = false;
    end_transfer(CommandState::unconfirmed, "another aircraft is on the link now");
  }
}

void Session::expect_vehicle(mavlink::Address vehicle) {
  forget_vehicle();
  expected_ = vehicle;
}

void Session::handle(const mavlink::Received& in) {
  const auto& m = in.message;
  if (m.is("HEARTBEAT")) return on_heartbeat(in);
  if (in.from != vehicle_) return;
  keep_alive();
  if (m.is("COMMAND_ACK")) return on_ack(m);
  const int lives = telemetry_.restarts();
  telemetry_.receive(m, autopilot_, now_s_);
  if (telemetry_.restarts() != lives) lists_lost("the autopilot was restarted since");
  on_transfer(m);
}

/// Whatever comes of the vehicle shows that the link lives, so that a lost heartbeat or two are no silence
/// (PX4 sends one a second). After a silence nothing but a heartbeat ends it: the mode may be another's now.
void Session::keep_alive() {
  if (!beat_s_ || now_s_ - *beat_s_ > k_mode_kept_s || now_s_ - *last_seen_s_ > k_silent_s) return;
  last_seen_s_ = now_s_;
}

void Session::on_heartbeat(const mavlink::Received& in) {
  const auto& m = in.message;
  if (!is_our_kind(m)) return;  // a station, a tracker, another vehicle
  if (expected_ && in.from != *expected_) return;
  expected_.reset();
  if (last_seen_s_ && in.from != vehicle_) {
    // One vehicle a session: the first heard, until it is silent for long and was not armed.
    if (now_s_ - *last_seen_s_ <= k_vehicle_kept_s || telemetry_.armed()) return;
    forget_vehicle();
  }
  if (last_seen_s_ && now_s_ - *last_seen_s_ > k_vehicle_kept_s && !telemetry_.armed()) {
    // Long enough to switch another one on under the same id.
    telemetry_.restarted();
    lists_lost("the aircraft was silent for " + std::to_string(static_cast<int>(now_s_ - *last_seen_s_)) +
               " s since, and may be another one");
  }
  vehicle_ = in.from;
  autopilot_ = autopilot_of(m.integer("autopilot"));
  last_seen_s_ = beat_s_ = now_s_;
  telemetry_.receive(m, autopilot_, now_s_);
  custom_mode_ = static_cast<std::uint32_t>(m.integer("custom_mode"));
  if (!telemetry_.armed()) drop_target("the aircraft is disarmed");
  confirm_shown();
  assess_mode();
}

/// What the heartbeat shows to be done, acknowledged or not.
void Session::confirm_shown() {
  const auto shown = [&](const Pending& p) {
    return p.number != 0 && ((p.proof == Proof::mode && p.mode == custom_mode_) ||
                             (p.proof == Proof::disarmed && !telemetry_.armed()));
  };
  for (auto it = std::find_if(pending_.begin(), pending_.end(), shown); it != pending_.end();
       it = std::find_if(pending_.begin(), pending_.end(), shown)) {
    Pending done = *it;
    pending_.erase(it);
    on_answer(done, 0);
  }
}

/// The mode that was acknowledged and given up has come after all.
bool Session::came_late() {
  auto& f = *flight_;
  if (!f.late || f.late->mode != custom_mode_ || now_s_ >= f.late->until_s) return false;
  const Late late = *std::exchange(f.late, std::nullopt);
  f.passing.erase(late.mode);
  f.wanted = late.mode;
  f.ours = f.reached = true;
  f.former.reset();
  if (!late.part) report(late.number, late.what, CommandState::accepted, "late");
  return true;
}

/// Any mode that was not commanded is the pilot's, or a failsafe's.
void Session::assess_mode() {
  if (!flight_ || flight_->taken_over || !flight_->wanted) return;
  auto& f = *flight_;
  if (custom_mode_ == *f.wanted) {
    if (!f.reached && custom_mode_ == dialect_of(autopilot_).guided) f.speed_due = true;
    f.reached = true;
    f.former.reset();
    return;
  }
  if (came_late()) return;
  const auto passing = f.passing.find(custom_mode_);
  if (passing != f.passing.end() && now_s_ < passing->second) {
    // It has left the mode it was in: who brings it back there is not us.
    if (f.former && *f.former != custom_mode_) f.former.reset();
    return;
  }
  // A mode of ours that stays, or the one in which it stands disarmed, is nobody's word: the command was not
  // done. A pilot's, which was there before, is his again.
  const bool not_yet =
      !f.reached && f.former && custom_mode_ == *f.former &&
      (f.former_ours || !telemetry_.armed() || !(f.acked_s && now_s_ - *f.acked_s > k_mode_shows_s));
  if (!not_yet) take_over();
}

void Session::take_over() {
  flight_->taken_over = true;
  const auto two = twins();
  const std::string why = two.empty() ? "the pilot or a failsafe has taken over: " +
                                            std::string(mode_word(autopilot_, custom_mode_))
                                      : two;
  for (const auto& p : std::exchange(pending_, {})) {
    if (!p.part) report(p.number, p.what, CommandState::refused, why);
  }
  if (flight_->take_off) {
    flight_->take_off->armed_here = false;  // whoever has it decides about its motors
    end_take_off(CommandState::refused, why);
  }
  drop_target(why);
}

void Session::take_back() {
  if (!flight_) return;
  auto& f = *flight_;
  f.taken_over = false;
  f.wanted = custom_mode_;
  // Nobody but a station commands these; the others may be the pilot's.
  const auto kind = mode_kind(autopilot_, custom_mode_);
  f.ours = kind == ModeKind::guided || kind == ModeKind::hold;
  f.reached = true;
  f.former.reset();
  f.late.reset();
  f.acked_s.reset();
  f.passing.clear();
}

std::string Session::twins() const {
  if (!telemetry_.two_autopilots(now_s_)) return "";
  return "two autopilots answer as system " + std::to_string(vehicle_.system) +
         ": switch one off, or give it another id (SYSID_THISMAV, MAV_SYS_ID)";
}

void Session::tick(double now_s, std::int64_t unix_us) {
  now_s_ = now_s;
  packer_.set_time(mavlink::signature_time(unix_us));
  if (now_s_ - heartbeat_s_ >= k_heartbeat_s - 1e-9) {
    heartbeat_s_ = now_s_;
    send(Message("HEARTBEAT")
             .set("type", 6)
             .set("autopilot", 8)
             .set("system_status", 4)
             .set("mavlink_version", 3));
  }
  if (!last_seen_s_) return;
  if (now_s_ - *last_seen_s_ <= k_silent_s) {
    if (auto question = telemetry_.question(autopilot_, now_s_)) {
      question->set("target_system", vehicle_.system).set("target_component", vehicle_.component);
      if (question->is("COMMAND_LONG"))
        send_command(*question, static_cast<int>(question->integer("command")), 0);
      else
        send(*question);
    }
  }
  drive_take_off();
  drive_target();
  drive_speed();
  drive_transfer();
  repeat_commands();
}

DroneStatus Session::status() const {
  DroneStatus out;
  telemetry_.fill(out, now_s_);
  out.autopilot = std::string(dialect_of(autopilot_).name);
  out.silent_s = last_seen_s_ ? now_s_ - *last_seen_s_ : now_s_;
  out.mode_age_s = beat_s_ ? now_s_ - *beat_s_ : now_s_;
  out.connected = last_seen_s_ && out.silent_s <= k_silent_s;
  if (!out.connected) out.stale.clear();  // the silence itself is what is wrong
  out.mode = last_seen_s_ ? std::string(mode_word(autopilot_, custom_mode_)) : "";
  out.mode_kind = last_seen_s_ ? mode_kind(autopilot_, custom_mode_) : ModeKind::other;
  out.taken_over = flight_ && flight_->taken_over;
  out.identity = {"", vehicle_.system, vehicle_.component};
  out.link_trouble = out.connected ? twins() : "";
  return out;
}

void Session::ask_parameters(const std::vector<std::string>& names) { telemetry_.ask_parameters(names); }

}  // namespace anchord::drone
