// What a flight does: telemetry in, orders out, reports read.
#include "api/services/flight_state.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "api/application.hpp"
#include "api/live/hub.hpp"
#include "api/services/event_log.hpp"
#include "core/base/to_wire.hpp"
#include "core/localize/live_flight.hpp"

namespace anchord::api {

using procedure::Command;
using procedure::Event;
using procedure::Step;

namespace {

constexpr double k_degree = std::numbers::pi / 180;
constexpr double k_in_air_m = 0.7;  ///< by hand: above home this much counts as flying
constexpr std::size_t k_commands = 30, k_missions = 8;

}  // namespace

bool ActiveFlight::flying() const {
  const auto step = engine.state().step;
  return !aborted && step != Step::ready && step != Step::done;
}

std::string ActiveFlight::status() const {
  if (aborted) return "aborted";
  switch (engine.state().step) {
    case Step::ready:
      return "ready";
    case Step::hold:
      return "hold";
    case Step::return_home:
      return "return";
    case Step::landing:
      return "landing";
    case Step::done:
      return "done";
    default:
      return "running";
  }
}

bool ActiveFlight::to_keep(std::string& text) {
  const auto n = engine.state().n_transitions + (aborted ? 1'000'000 : 0);
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
  text = to_wire(nlohmann::ordered_json{{"plan", nlohmann::json::parse(stored(plan).document_json)},
                                        {"plan_id", to_string(plan.id)},
                                        {"plan_revision", plan.version},
                                        {"manual", manual},
                                        {"origin", {o.lat_deg, o.lon_deg, o.height_m}},
                                        {"home_m", {home_m.x(), home_m.y(), home_m.z()}},
                                        {"state", stored_state(engine.state())},
                                        {"clues", told}});
  return true;
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

FlightCommand& FlightService::State::note(std::string action, std::string by, std::string state) {
  if (by != "procedure" && by != "checklist") newest_by_person = number + 1;
  commands.push_back({++number, std::move(action), std::move(state), "", std::move(by), deps.clock.now()});
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
  f.engine.fix(now, at, fix.fix);
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
  flight->engine.range(now, result.range.anchor, result.used(), result.range.rss_dbm,
                       result.range.distance_m);
}

void FlightService::State::telemetry(ActiveFlight& f) {
  const double now = now_s();
  if (f.manual) {
    if (f.by_hand.position_m && f.former_s) f.engine.vehicle(*f.former_s, f.by_hand);
    return;
  }
  const DroneStatus d = deps.drone->status();
  if (d.autopilot.empty()) return;  // never heard
  procedure::VehicleView view;
  if (d.position) {
    Eigen::Vector3d at =
        f.frame.enu_from_wgs84({d.position->lat_deg, d.position->lon_deg, f.frame.origin().height_m}).m;
    // The autopilot's height is above sea level or home; home is where we know both.
    at.z() = f.home_m.z() + d.relative_m.value_or(0);
    view.position_m = at;
  }
  if (d.heading_deg) view.heading_rad = *d.heading_deg * k_degree;
  view.speed_mps = d.speed_mps.value_or(0);
  view.armed = d.armed;
  view.in_air = d.in_air;
  view.battery = d.battery;
  // A heartbeat comes once a second: that much silence is none.
  f.engine.vehicle(now - std::max(0.0, d.silent_s - 1.2), view);
  if (d.taken_over && !f.taken_over) {
    f.taken_over = true;
    f.engine.command(now, Event::hold, "");
    (void)f.engine.take_orders();  // the aircraft is the pilot's: not even a hold is sent
  }
  if (f.owed && d.connected) {
    const Command late{*std::exchange(f.owed, std::nullopt), {0, 0, 0}, std::nullopt};
    auto& c = note(std::string(procedure::to_string(late.kind)), "procedure", "sent");
    by_drone_number[send(f, late)] = c.number;
  }
}

std::uint64_t FlightService::State::send(ActiveFlight& f, const Command& order) {
  auto& drone = *deps.drone;
  switch (order.kind) {
    case Command::Kind::take_off:
      return drone.take_off(order.point_m.z() - f.home_m.z());
    case Command::Kind::go_to: {
      const Wgs84 to = f.frame.wgs84_from_enu(Enu{order.point_m});
      std::optional<double> heading;
      if (order.heading_rad) heading = std::fmod(*order.heading_rad / k_degree + 720, 360.0);
      return drone.go_to(to.lat_deg, to.lon_deg, order.point_m.z() - f.home_m.z(), heading);
    }
    case Command::Kind::hold:
      return drone.hold();
    case Command::Kind::return_home:
      return drone.return_home();
    case Command::Kind::land:
      return drone.land();
    case Command::Kind::measure:
    case Command::Kind::decide:
      break;
  }
  return 0;
}

/// The first order that follows from an operator's command decides that command's fate.
void FlightService::State::send_orders(ActiveFlight& f, FlightCommand* cause) {
  for (const auto& order : f.engine.take_orders()) {
    if (f.manual) {
      if (cause != nullptr) cause->state = "accepted", cause->text = "shown to the pilot";
      continue;
    }
    const bool must_arrive = order.kind == Command::Kind::hold || order.kind == Command::Kind::land ||
                             order.kind == Command::Kind::return_home;
    if (must_arrive && !deps.drone->status().connected) f.owed = order.kind;
    const std::uint64_t sent = send(f, order);
    if (cause != nullptr) {
      by_drone_number[sent] = std::exchange(cause, nullptr)->number;
    } else {
      by_drone_number[sent] = note(std::string(procedure::to_string(order.kind)), "procedure", "sent").number;
    }
  }
  if (cause != nullptr) cause->state = "accepted", cause->text = f.engine.state().reason;
  while (by_drone_number.size() > 200) by_drone_number.erase(by_drone_number.begin());
}

void FlightService::State::read_reports() {
  if (deps.drone == nullptr) return;
  for (const auto& r : deps.drone->take_reports()) {
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
    if (r.state == CommandState::accepted) {
      unconfirmed.reset();
    } else {
      if (r.state == CommandState::refused)
        deps.events.add("warning", "cmd.refused", c->action + " refused: " + r.text, mission);
      unconfirmed = c->number;
      if (flight && r.what == "go_to" && r.state == CommandState::refused)
        flight->engine.command(now_s(), Event::unreachable, "");
    }
  }
}

void FlightService::State::tell_happenings(ActiveFlight& f) {
  for (auto& h : f.engine.take_happenings()) {
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
  if (!flight || flight->aborted) return;
  auto& f = *flight;
  telemetry(f);
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
  const bool ready = f.engine.state().step != Step::find_next_point || live != nullptr;
  if (ready) f.engine.tick(now_s(), estimates);
  if (!f.taken_over) send_orders(f, nullptr);
  tell_happenings(f);
}

}  // namespace anchord::api
