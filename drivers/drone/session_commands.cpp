// Commands and their answers.
#include <algorithm>
#include <cmath>
#include <utility>

#include "drivers/drone/commands.hpp"
#include "drivers/drone/session.hpp"

namespace anchord::drone {
namespace {

using mavlink::Message;

constexpr double k_answers_late_s = 4, k_superseded_s = 3, k_lost_s = 10;

}  // namespace

void Session::send_command(const Message& message, int command, std::uint64_t number) {
  std::erase_if(sent_, [&](const Sent& s) { return now_s_ - s.at_s > k_answers_late_s; });
  sent_.push_back({command, number, now_s_});
  send(message);
}

Message Session::command_long(int command, std::initializer_list<double> params) const {
  Message m = addressed("COMMAND_LONG");
  m.set("command", command);
  int i = 1;
  for (const double p : params) m.set_real("param" + std::to_string(i++), p);
  return m;
}

void Session::command(std::uint64_t number, const std::string& what, int command,
                      std::initializer_list<double> params, bool part, Proof proof, std::uint32_t mode) {
  // One of a kind at a time: a newer one takes the place of the older.
  for (const auto& p : pending_) {
    if (p.command == command && !p.part)
      report(p.number, p.what, CommandState::unconfirmed,
             "followed by " + what + " before it was " + (p.acked_s ? "done" : "answered"));
  }
  std::erase_if(pending_, [&](const Pending& p) { return p.command == command; });
  Message m = command_long(command, params);
  send_command(m, command, number);
  pending_.push_back({number, what, std::move(m), command, part, proof, mode, now_s_, now_s_, {}});
}

/// A mode number means nothing before it is known whose it is.
bool Session::deaf(std::uint64_t number, const std::string& what) {
  if (last_seen_s_ && autopilot_ != Autopilot::unknown) return false;
  report(number, what, CommandState::refused,
         last_seen_s_ ? "the autopilot is neither ArduPilot nor PX4"
                      : "no heartbeat is received from the aircraft");
  return true;
}

/// From now on this mode is ours, and no other but those on the way to it.
void Session::want(std::uint32_t custom_mode) {
  if (!flight_) return;
  auto& f = *flight_;
  if (f.wanted && *f.wanted != custom_mode) f.passing[*f.wanted] = now_s_ + k_superseded_s;
  f.passing.erase(custom_mode);
  f.late.reset();
  f.former_ours = f.wanted == custom_mode_ ? f.ours : !f.reached && f.former == custom_mode_ && f.former_ours;
  f.former = custom_mode_;
  f.wanted = custom_mode;
  f.ours = true;
  f.reached = custom_mode_ == custom_mode;
  f.acked_s.reset();
}

void Session::command_mode(std::uint64_t number, const std::string& what, std::uint32_t custom_mode,
                           bool part) {
  const bool shown = custom_mode_ == custom_mode;
  want(custom_mode);
  const auto params = mode_params(autopilot_, custom_mode);
  command(number, what, k_set_mode, {1, params.main, params.sub}, part, shown ? Proof::answer : Proof::mode,
          custom_mode);
}

/// It was not done: the mode is what it was, and not a pilot's for that. Perhaps the other comes yet.
void Session::keep_mode(const Pending& lost) {
  if (!flight_ || lost.command != k_set_mode || flight_->reached || !flight_->wanted) return;
  auto& f = *flight_;
  f.passing[*f.wanted] = now_s_ + k_lost_s;
  if (lost.acked_s && lost.proof == Proof::mode)
    f.late = Late{lost.mode, lost.number, lost.what, lost.part, now_s_ + k_lost_s};
  f.wanted = custom_mode_;
  f.ours = f.former_ours;
  f.reached = true;
}

std::string Session::not_done(const Pending& p) const {
  if (!p.acked_s) return "no answer within 2 s";
  if (*beat_s_ <= *p.acked_s) return "accepted, but no heartbeat since then shows that it was done";
  return p.proof == Proof::disarmed
             ? "accepted, but it stays armed"
             : "accepted, but it stays in " + std::string(mode_word(autopilot_, custom_mode_));
}

std::uint64_t Session::mode(const std::string& what, std::uint32_t Dialect::*wanted) {
  const std::uint64_t number = ++number_;
  if (deaf(number, what)) return number;
  end_take_off(CommandState::refused, "followed by " + what);
  drop_target("followed by " + what);
  report(number, what, CommandState::sent, "");
  command_mode(number, what, dialect_of(autopilot_).*wanted, false);
  return number;
}

std::uint64_t Session::hold() { return mode("hold", &Dialect::hold); }
std::uint64_t Session::return_home() { return mode("return_home", &Dialect::return_home); }
std::uint64_t Session::land() { return mode("land", &Dialect::land); }

std::uint64_t Session::disarm() {
  const std::uint64_t number = ++number_;
  if (deaf(number, "disarm")) return number;
  end_take_off(CommandState::refused, "followed by disarm");
  drop_target("followed by disarm");
  report(number, "disarm", CommandState::sent, "");
  command(number, "disarm", k_arm, {0, 0}, false, telemetry_.armed() ? Proof::disarmed : Proof::answer);
  return number;
}

/// What the autopilot has said against it since then.
std::string Session::said_since(double since_s) const {
  return telemetry_.warning_s() >= since_s ? telemetry_.warning() : "";
}

void Session::on_ack(const Message& m) {
  const auto for_system = m.integer("target_system");
  if (for_system != 0 && for_system != options_.self.system) return;  // another station's
  const auto command = static_cast<int>(m.integer("command"));
  const auto result = m.integer("result");
  if (command == k_interval) return telemetry_.answer(result);
  const auto sent =
      std::find_if(sent_.begin(), sent_.end(), [&](const Sent& s) { return s.command == command; });
  if (sent == sent_.end()) return;
  const auto number = sent->number;
  const auto it = std::find_if(pending_.begin(), pending_.end(),
                               [&](const Pending& p) { return p.command == command && p.number == number; });
  if (result == 5) {  // in progress: more follow
    if (it != pending_.end()) it->first_s = it->last_s = now_s_;
    return;
  }
  sent_.erase(sent);
  if (it == pending_.end() || it->acked_s) return;  // late: something newer was commanded; of a repeat
  if (result == 0 && it->proof != Proof::answer) {
    it->acked_s = now_s_;
    if (flight_ && command == k_set_mode) flight_->acked_s = now_s_;
    return;
  }
  Pending done = *it;
  pending_.erase(it);
  on_answer(done, result);
}

void Session::on_answer(Pending& done, std::int64_t result) {
  if (flight_ && done.command == k_set_mode) {
    if (result == 0) {
      flight_->acked_s = now_s_;
    } else {
      flight_->wanted = custom_mode_;  // it stays what it was
      flight_->ours = flight_->former_ours;
      flight_->reached = true;
    }
  }
  // A take-off that is told again in the air fails: what was asked once has happened.
  const bool repeated = done.what == "take-off" && done.message.integer("confirmation") > 0;
  if (flight_ && flight_->take_off && flight_->take_off->number == done.number && result != 0 && !repeated) {
    flight_->take_off->refused_s = now_s_;
    flight_->take_off->refusal = done.what + " " + result_word(result);
  }
  if (done.part) return;  // telemetry decides
  if (result == 0) return report(done.number, done.what, CommandState::accepted, "");
  const auto said = said_since(done.first_s);
  report(done.number, done.what, CommandState::refused,
         result_word(result) + (said.empty() ? "" : ": " + said));
}

void Session::repeat_commands() {
  for (std::size_t i = 0; i < pending_.size();) {
    auto& p = pending_[i];
    const double until_s =
        std::max(p.first_s + options_.confirm_s, p.acked_s ? *p.acked_s + k_mode_shows_s : 0);
    if (now_s_ >= until_s) {
      const Pending lost = p;
      pending_.erase(pending_.begin() + static_cast<std::ptrdiff_t>(i));
      keep_mode(lost);
      if (!lost.part) report(lost.number, lost.what, CommandState::unconfirmed, not_done(lost));
      continue;
    }
    // What changes the mode waits for a heartbeat: it would show that the pilot has changed it meanwhile.
    const bool changes_mode = p.command == k_set_mode || p.command == k_reposition || p.command == k_take_off;
    if (!p.acked_s && now_s_ - p.last_s >= options_.repeat_s && (!changes_mode || *beat_s_ > p.last_s)) {
      p.last_s = now_s_;
      if (p.message.is("COMMAND_LONG")) p.message.set("confirmation", p.message.integer("confirmation") + 1);
      send_command(p.message, p.command, p.number);
    }
    ++i;
  }
}

}  // namespace anchord::drone
