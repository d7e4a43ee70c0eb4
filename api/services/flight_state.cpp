// What a flight does: telemetry in, orders out, reports read.
#include "api/services/flight_state.hpp"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "api/application.hpp"
#include "api/live/hub.hpp"
#include "api/services/event_log.hpp"
#include "api/services/late_writer.hpp"
#include "core/base/to_wire.hpp"
#include "core/localize/live_flight.hpp"

namespace anchord::api {

using procedure::Step;

namespace {

constexpr double k_in_air_m = 0.7;  ///< by hand: above home this much counts as flying
constexpr std::size_t k_commands = 60, k_missions = 8;

}  // namespace

bool ActiveFlight::flying() const {
  const auto step = control.engine().state().step;
  return aborted.empty() && step != Step::ready && step != Step::done;
}

std::string ActiveFlight::status() const {
  if (!aborted.empty()) return "aborted";
  switch (control.engine().state().step) {
    case Step::ready:
      return "ready";
    case Step::hold:
      return "hold";
    case Step::return_home:
      return "return";
    case Step::landing:
      return "landing";
    case Step::done:  // only what was promised
      return control.engine().state().completed ? "done" : "aborted";
    default:
      return "running";
  }
}

std::string ActiveFlight::ended() const { return aborted.empty() ? control.engine().state().ended : aborted; }

bool ActiveFlight::to_keep(std::string& text) {
  const auto n = control.engine().state().n_transitions + (aborted.empty() ? 0 : 1'000'000);
  if (n == kept) return false;
  kept = n;
  text.clear();
  const auto told = stored_clues(clues());
  if (!flying()) {
    // What turns and height searches told outlives the flight: every calibration of it asks for it.
    if (!told.empty()) text = to_wire(nlohmann::ordered_json{{"landed", true}, {"clues", told}});
    return true;
  }
  const auto& o = frame.origin();
  text = to_wire(nlohmann::ordered_json{
      {"plan", nlohmann::json::parse(stored(plan).document_json)},
      {"plan_id", to_string(plan.id)},
      {"plan_revision", plan.version},
      {"manual", manual},
      {"aircraft", {{"peer", aircraft.peer}, {"system", aircraft.system}, {"component", aircraft.component}}},
      {"origin", {o.lat_deg, o.lon_deg, o.height_m}},
      {"home_m", {home_m.x(), home_m.y(), home_m.z()}},
      {"state", stored_state(control.engine().state())},
      {"clues", told}});
  return true;
}

/// A disk that is slow or full makes no flight wait: what is written last is what a restart finds.
void FlightService::State::keep(const MissionId& mission, std::string document) const {
  const auto write = [&plans = deps.plans, mission, document = std::move(document), now = deps.clock.now()] {
    return plans.keep_procedure(mission, document, now);
  };
  if (deps.late != nullptr)
    deps.late->write(write);
  else
    (void)write().has_value();
}

double FlightService::State::now_s() const {
  if (deps.now_s) return deps.now_s();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

const ActiveFlight* FlightService::State::flight_of(const MissionId& mission) const {
  return flight && flight->mission == mission ? &*flight : nullptr;
}

FlightCommand* FlightService::State::find(std::uint64_t wanted) {
  for (auto& c : commands) {
    if (c.number == wanted) return &c;
  }
  return nullptr;
}

FlightCommand& FlightService::State::note(const MissionId& mission, std::string action, std::string by,
                                          std::string state) {
  if (by != "procedure" && by != "checklist") newest_by_person = number + 1;
  commands.push_back(
      {++number, std::move(action), std::move(state), "", std::move(by), deps.clock.now(), mission});
  if (commands.size() > k_commands) commands.pop_front();
  return commands.back();
}

void FlightService::State::hear(const Fix& fix) {
  const double now = now_s();
  auto& h = heard[fix.mission];
  if (heard.size() > k_missions) {
    std::erase_if(heard, [&](const auto& one) { return one.first != fix.mission && !flight_of(one.first); });
  }
  const bool fixed = fix.fix == FixClass::rtk_fixed;
  const bool unbroken = h.fixed_since_s && h.fix_s && now - *h.fix_s < 2;
  h.fixed_since_s = !fixed ? std::nullopt : unbroken ? h.fixed_since_s : std::optional(now);
  h.fix_s = now;
  h.correction_age_s = fix.correction_age_s;
  h.fix = fix;
  if (!flight || flight->mission != fix.mission || fix.frame != TrackFrame::wgs84) return;
  auto& f = *flight;
  const Eigen::Vector3d at = f.frame.enu_from_wgs84(fix.position).m;
  f.control.fix(now, at, fix.fix);
  if (f.manual && fix.fix != FixClass::none) {
    auto& v = f.by_hand;
    if (f.former_m && now > *f.former_s) v.speed_mps = (at - *f.former_m).norm() / (now - *f.former_s);
    v.position_m = at;
    v.in_air = v.armed = at.z() - f.home_m.z() > k_in_air_m;
    f.former_m = at;
    f.former_s = now;
  }
}

void FlightService::State::hear(const MissionId& mission, const RangeResult& result) {
  const double now = now_s();
  heard[mission].range_s = now;
  if (!flight || flight->mission != mission) return;
  // No estimate yet is no reason: what counts is that the exchange worked.
  flight->control.engine().range(now, result.range.anchor, result.used(), result.range.rss_dbm,
                                 result.range.distance_m);
}

/// The first order that follows from an operator's command decides that command's fate.
void FlightService::State::note_dispatched(ActiveFlight& f, FlightCommand* cause) {
  const auto wanted = cause == nullptr ? 0 : cause->number;
  for (const auto& one : f.control.take_dispatched()) {
    auto* command = cause;
    if (cause == nullptr)
      command = f.manual ? nullptr
                         : &note(f.mission, std::string(procedure::to_string(one.kind)), "procedure", "sent");
    cause = nullptr;
    if (command == nullptr) continue;
    if (one.number != 0) {
      by_drone_number[one.number] = command->number;
    } else if (one.not_sent.empty()) {
      command->state = "accepted", command->text = "shown to the pilot";
    } else {
      command->state = "refused", command->text = one.not_sent;
    }
  }
  if (cause != nullptr) {
    if (auto* unanswered = find(wanted))
      unanswered->state = "accepted", unanswered->text = f.control.engine().state().reason;
  }
  while (by_drone_number.size() > 200) by_drone_number.erase(by_drone_number.begin());
}

void FlightService::State::read_reports() {
  if (deps.drone == nullptr) return;
  for (const auto& r : deps.drone->take_reports()) {
    if (flight && flight->flying() && !flight->manual) flight->control.report(now_s(), r);
    const auto ours = by_drone_number.find(r.number);
    if (ours == by_drone_number.end()) continue;
    auto* c = find(ours->second);
    if (c == nullptr || r.state == CommandState::sent) continue;
    c->state = r.state == CommandState::accepted  ? "accepted"
               : r.state == CommandState::refused ? "refused"
                                                  : "unconfirmed";
    c->text = r.text;
    for (auto& u : uploads) {
      if (u.command.number == c->number) u.command = *c;
    }
    const auto mission = flight ? std::optional(flight->mission) : std::nullopt;
    const bool superseded = r.text.rfind("followed by ", 0) == 0 || r.text == "the flight is over";
    if (r.state == CommandState::accepted) {
      unconfirmed.reset();
    } else if (!superseded) {
      if (r.state == CommandState::refused)
        deps.events.add("warning", "cmd.refused", c->action + " refused: " + r.text, mission);
      unconfirmed = c->number;
    }
  }
}

void FlightService::State::tell_happenings(ActiveFlight& f) {
  for (auto& h : f.control.engine().take_happenings()) {
    const bool by_the_board =
        h.code.ends_with(".cleared") ||
        std::find(k_flight_alarms.begin(), k_flight_alarms.end(), h.code) != k_flight_alarms.end();
    if (!by_the_board) deps.events.add(std::move(h.level), std::move(h.code), std::move(h.text), f.mission);
  }
}

void FlightService::State::round(const MissionService::LiveView* live) {
  if (lease.just_ended(moment())) {
    deps.events.add(flight && flight->flying() ? "warning" : "info", "control.ended",
                    "control ended: it was not renewed for a minute",
                    flight ? std::optional(flight->mission) : std::nullopt);
    publish_soon();
  }
  read_reports();
  give_fence();
  if (!flight || !flight->flying()) checks_apart.pause();
  if (!flight || !flight->aborted.empty()) return;
  auto& f = *flight;
  if (f.manual && f.by_hand.position_m && f.former_s) f.control.by_hand(*f.former_s, f.by_hand);
  std::vector<Estimate> estimates;
  if (live != nullptr && live->origin) {
    const EnuFrame theirs(*live->origin);
    for (auto e : live->estimates) {
      for (auto* place : {&e.best, &e.mirror}) {
        if (!*place) continue;
        (*place)->position = f.frame.enu_from_wgs84(theirs.wgs84_from_enu((*place)->position));
        (*place)->covariance_m2 = theirs.covariance_in(f.frame, (*place)->covariance_m2);
      }
      estimates.push_back(std::move(e));
    }
  }
  // Without answers a decision would be one of ignorance: it is made when they were read.
  const bool ready = f.control.engine().state().step != Step::find_next_point || live != nullptr;
  const double now = now_s();
  if (f.flying()) checks_apart.note(now);
  f.control.round(now, estimates, ready);
  note_dispatched(f, nullptr);
  tell_happenings(f);
}

}  // namespace anchord::api
