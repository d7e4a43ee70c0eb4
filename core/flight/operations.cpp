// What a flight does: measurements and telemetry in, commands out, reports read.
#include "core/flight/operations.hpp"

#include <algorithm>

#include "core/localize/live_flight.hpp"
#include "core/ports/drone.hpp"

namespace anchord::flight {

using procedure::Step;

namespace {

constexpr double k_in_air_m = 0.7;  ///< by hand: above home this much counts as flying
constexpr double k_break_s = 2;     ///< without a fix so long, RTK was not fixed without a break
constexpr std::size_t k_commands = 60, k_missions = 8, k_numbers = 200;

EventPlace place_of(const Eigen::Vector3d& plan_m, const EnuFrame& frame) {
  const Wgs84 at = frame.wgs84_from_enu(Enu{plan_m});
  return {at.lat_deg, at.lon_deg, plan_m.z()};
}

}  // namespace

bool ActiveFlight::flying() const {
  const auto step = control.engine().state().step;
  return aborted.empty() && step != Step::ready && step != Step::done;
}

FlightStatus ActiveFlight::status() const {
  if (!aborted.empty()) return FlightStatus::aborted;
  switch (control.engine().state().step) {
    case Step::ready:
      return FlightStatus::ready;
    case Step::hold:
      return FlightStatus::hold;
    case Step::return_home:
      return FlightStatus::returning;
    case Step::landing:
      return FlightStatus::landing;
    case Step::done:  // only what was promised
      return control.engine().state().completed ? FlightStatus::done : FlightStatus::aborted;
    default:
      return FlightStatus::running;
  }
}

std::string ActiveFlight::ended() const { return aborted.empty() ? control.engine().state().ended : aborted; }

std::optional<FlownTime> ActiveFlight::flown_time() const {
  const auto& engine = control.engine();
  if (flying() || engine.state().n_transitions == 0) return std::nullopt;
  return FlownTime{forecast_at_start, engine.flown_s(aborted_s), engine.state().completed && aborted.empty(),
                   changes.n > 0};
}

const FlightCommand* Operations::command(std::uint64_t number) const {
  const auto it = std::ranges::find(commands_, number, &FlightCommand::number);
  return it == commands_.end() ? nullptr : &*it;
}

FlightCommand* Operations::find(std::uint64_t number) {
  const auto it = std::ranges::find(commands_, number, &FlightCommand::number);
  return it == commands_.end() ? nullptr : &*it;
}

FlightCommand& Operations::note(const Now& now, const MissionId& mission, std::string_view action,
                                std::string by) {
  if (by != "procedure" && by != "checklist") newest_by_person_ = number_ + 1;
  commands_.push_back(
      {++number_, std::string(action), CommandState::sent, "", std::move(by), now.utc, mission});
  if (commands_.size() > k_commands) commands_.pop_front();
  return commands_.back();
}

void Operations::fix(const Now& now, const Fix& fix) {
  auto& r = received_[fix.mission];
  if (received_.size() > k_missions) {
    std::erase_if(received_,
                  [&](const auto& one) { return one.first != fix.mission && !flight_of(one.first); });
  }
  const double measured_s = r.fixes.at(fix.time, now.s);
  // A row that waited for stored ones to be read is no news: the pilot had it, or a newer one, at once.
  if (r.fix && std::pair(measured_s, fix.time) <= std::pair(*r.fix_s, r.fix->time)) return;
  const bool fixed = fix.fix == FixClass::rtk_fixed;
  const bool unbroken = r.fixed_since_s && r.fix_s && measured_s - *r.fix_s < k_break_s;
  r.fixed_since_s = !fixed ? std::nullopt : unbroken ? r.fixed_since_s : std::optional(measured_s);
  r.fix_s = measured_s;
  r.correction_age_s = fix.correction_age_s;
  r.fix = fix;
  if (!flight_ || flight_->mission != fix.mission || fix.frame != TrackFrame::wgs84) return;
  auto& f = *flight_;
  const Eigen::Vector3d at = f.frame.enu_from_wgs84(fix.position).m;
  f.control.fix(measured_s, at, fix.fix);
  if (f.manual && fix.fix != FixClass::none) {
    auto& v = f.by_hand;
    if (f.former_m && measured_s > *f.former_s)
      v.speed_mps = (at - *f.former_m).norm() / (measured_s - *f.former_s);
    v.position_m = at;
    v.in_air = v.armed = at.z() - f.home_m.z() > k_in_air_m;
    f.former_m = at;
    f.former_s = measured_s;
  }
}

void Operations::range(const Now& now, const MissionId& mission, const RangeResult& result) {
  auto& r = received_[mission];
  const double measured_s = r.ranges.at(result.range.time, now.s);
  r.range_s = measured_s;
  r.unknown_tag = result.refused == "unknown_tag" ? std::optional(result.range.tag) : std::nullopt;
  if (!flight_ || flight_->mission != mission) return;
  // No estimate yet is no reason: what counts is that the exchange worked.
  flight_->control.engine().range(measured_s, result.range.anchor, result.used(), result.range.rss_dbm,
                                  result.range.distance_m);
}

/// The first order that follows from an operator's command decides that command's fate.
void Operations::note_dispatched(const Now& now, ActiveFlight& f, FlightCommand* cause) {
  const auto wanted = cause == nullptr ? 0 : cause->number;
  for (const auto& one : f.control.take_dispatched()) {
    auto* command = cause;
    if (cause == nullptr)
      command = f.manual ? nullptr : &note(now, f.mission, procedure::to_string(one.kind), "procedure");
    cause = nullptr;
    if (command == nullptr) continue;
    if (one.number != 0) {
      by_drone_number_[one.number] = command->number;
    } else if (one.not_sent.empty()) {
      command->state = CommandState::accepted;
      command->text = "shown to the pilot";
    } else {
      command->state = CommandState::refused;
      command->text = one.not_sent;
    }
  }
  if (cause != nullptr) {
    if (auto* unanswered = find(wanted)) {
      unanswered->state = CommandState::accepted;
      unanswered->text = f.control.engine().state().reason;
    }
  }
  while (by_drone_number_.size() > k_numbers) by_drone_number_.erase(by_drone_number_.begin());
}

void Operations::read_reports(const Now& now) {
  if (drone_ == nullptr) return;
  for (const auto& r : drone_->take_reports()) {
    if (flying() && !flight_->manual) flight_->control.report(now.s, r);
    const auto ours = by_drone_number_.find(r.number);
    if (ours == by_drone_number_.end()) continue;
    auto* c = find(ours->second);
    if (c == nullptr || r.state == CommandState::sent) continue;
    c->state = r.state;
    c->text = r.text;
    for (auto& u : uploads_) {
      if (u.command.number == c->number) u.command = *c;
    }
    const auto mission = flight_ ? std::optional(flight_->mission) : std::nullopt;
    const bool superseded = r.text.rfind("followed by ", 0) == 0 || r.text == "the flight is over";
    if (r.state == CommandState::accepted) {
      unconfirmed_.reset();
    } else if (!superseded) {
      if (r.state == CommandState::refused)
        log_event(EventLevel::warning, "cmd.refused", c->action + " refused: " + r.text, mission);
      unconfirmed_ = c->number;
    }
  }
}

void Operations::take_events(ActiveFlight& f) {
  for (auto& h : f.control.engine().take_events()) {
    const bool by_the_board =
        h.code.ends_with(".cleared") || std::ranges::find(k_flight_alarms, h.code) != k_flight_alarms.end();
    if (by_the_board) continue;
    log_event(h.level, std::move(h.code), std::move(h.text), f.mission,
              h.place_m ? std::optional(place_of(*h.place_m, f.frame)) : std::nullopt);
  }
}

void Operations::round(const Now& now, const std::optional<Estimates>& live, bool at_hand) {
  if (lease_.just_ended(now)) {
    log_event(flying() ? EventLevel::warning : EventLevel::info, "control.ended",
              "control ended: it was not renewed for one minute",
              flight_ ? std::optional(flight_->mission) : std::nullopt);
    show_soon_ = true;
  }
  read_reports(now);
  give_fence(now);
  if (!flight_ || !flight_->aborted.empty()) return;
  auto& f = *flight_;
  if (f.manual && f.by_hand.position_m && f.former_s) f.control.by_hand(*f.former_s, f.by_hand);
  std::vector<Estimate> estimates;
  if (live) {
    const EnuFrame theirs(live->origin);
    for (auto e : live->estimates) {
      for (auto* place : {&e.best, &e.mirror}) {
        if (!*place) continue;
        (*place)->position = f.frame.enu_from_wgs84(theirs.wgs84_from_enu((*place)->position));
        (*place)->covariance_m2 = theirs.covariance_in(f.frame, (*place)->covariance_m2);
      }
      estimates.push_back(std::move(e));
    }
  }
  f.control.round(now.s, estimates, at_hand);
  note_dispatched(now, f, nullptr);
  take_events(f);
  if (!f.manual) f.aircraft = drone_->status().identity;
}

std::optional<Operations::PointTask> Operations::take_point_task() {
  if (!flight_) return std::nullopt;
  auto task = flight_->control.engine().take_point_task();
  if (!task) return std::nullopt;
  return PointTask{*std::move(task), n_flights_};
}

void Operations::decided(const PointTask& task, Result<planning::Decision> decision) {
  if (flight_ && task.flight == n_flights_)
    flight_->control.engine().decided(task.number, std::move(decision));
}

/// One that lands, or that the pilot has, is left to it.
void Operations::halt() {
  if (flying() && !flight_->manual && drone_ != nullptr && !flight_->control.taken_over() &&
      flight_->control.engine().state().step != Step::landing)
    drone_->hold();
}

std::vector<std::pair<std::string_view, std::string>> Operations::alarms() const {
  const bool flies = flying();
  std::vector<std::pair<std::string_view, std::string>> out;
  for (const auto id : k_flight_alarms) {
    const auto& alarm = flies ? flight_->control.engine().alarm() : std::nullopt;
    out.emplace_back(id, alarm && alarm->id == id ? alarm->text : "");
  }
  const std::string who = drone_ == nullptr ? "" : drone_->status().link_trouble;
  out.emplace_back("drone.taken_over", !flies || !flight_->control.taken_over() ? ""
                                       : who.empty()
                                           ? "the pilot or a failsafe has taken over"
                                           : "nothing is commanded: it is not known whose mode that is");
  out.emplace_back("drone.identity", who);
  // Until the next flight, or until somebody says that he knows.
  const bool failed = flight_ && flight_->status() == FlightStatus::aborted && flight_->aborted.empty() &&
                      !flight_->control.engine().state().by_person;
  out.emplace_back("flight.aborted", failed ? "the flight ended early: " + flight_->ended() : "");
  std::string silent;
  for (const auto& c : commands_) {
    if (flies && unconfirmed_ && c.number == *unconfirmed_)
      silent = c.action + " " + std::string(to_string(c.state)) + ": " + c.text;
  }
  out.emplace_back("cmd.unconfirmed", std::move(silent));
  std::string stale;
  if (flies && !flight_->manual && drone_ != nullptr) {
    for (const auto& name : drone_->status().stale) stale += (stale.empty() ? "" : ", ") + name;
    if (!stale.empty()) stale = "no telemetry for 5 s although the autopilot answers: " + stale;
  }
  out.emplace_back("drone.telemetry", std::move(stale));
  return out;
}

std::optional<DroneStatus> Operations::drone() const {
  return drone_ == nullptr ? std::nullopt : std::optional(drone_->status());
}

}  // namespace anchord::flight
