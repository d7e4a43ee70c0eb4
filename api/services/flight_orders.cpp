// What an operator asks of a flight: begin, command, check; what a restart brings back; what is shown.
#include <nlohmann/json.hpp>

#include "api/application.hpp"
#include "api/live/hub.hpp"
#include "api/services/event_log.hpp"
#include "api/services/flight_state.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {

using procedure::Event;

namespace {

constexpr std::size_t k_checks = 64;
constexpr std::ptrdiff_t k_shown_commands = 30;

std::optional<Event> event_of_action(const std::string& action) {
  if (action == "hold") return Event::hold;
  if (action == "resume") return Event::resume;
  if (action == "skip") return Event::skip;
  if (action == "return") return Event::return_home;
  if (action == "land") return Event::land;
  return std::nullopt;
}

/// A plan without an origin has its ground where the aircraft stands.
Result<Plan> flown_plan(const Plan& plan, double ground_m) {
  BOOST_OUTCOME_TRY(Wgs84 origin, planning::plan_origin(plan));
  if (!plan.origin) origin.height_m = ground_m;
  Plan flown = plan;
  flown.origin = origin;
  return flown;
}

Error forbidden(std::string why) { return make_error(Errc::invalid_argument, std::move(why)); }

}  // namespace

FlightService::State::Groundwork FlightService::State::groundwork(const Plan* plan) {
  Groundwork ground{plan, nullptr, deps.storage ? deps.storage() : StorageStatus{}};
  if (plan == nullptr) return ground;
  {
    const std::scoped_lock lock(checks_mutex);
    for (const auto& known : checks) {
      if (known.plan == plan->id && known.revision == plan->version) ground.check = known.check;
    }
  }
  if (ground.check) return ground;
  if (auto judged = planning::check_plan(*plan))
    ground.check = std::make_shared<const planning::PlanCheck>(std::move(judged).value());
  const std::scoped_lock lock(checks_mutex);
  checks.push_back({plan->id, plan->version, ground.check});
  if (checks.size() > k_checks) checks.pop_front();
  return ground;
}

std::vector<ChecklistItem> FlightService::State::checklist(const Mission* record, const MissionId& mission,
                                                           const Groundwork& ground, bool manual) {
  const Plan* plan = ground.plan;
  ChecklistFacts facts;
  facts.mission = record;
  if (plan != nullptr) facts.min_battery = plan->settings.min_battery;
  facts.plan = ground.check.get();
  if (!manual && deps.drone != nullptr) facts.drone = deps.drone->status();
  const double now = now_s();
  if (const auto it = heard.find(mission); it != heard.end()) {
    const auto& h = it->second;
    if (h.fix_s) facts.fix_age_s = now - *h.fix_s;
    if (h.fix) facts.fix = h.fix->fix;
    if (h.fixed_since_s) facts.fixed_for_s = now - *h.fixed_since_s;
    if (h.range_s) facts.range_age_s = now - *h.range_s;
    if (facts.fix_age_s && h.correction_age_s)
      facts.correction_age_s = *facts.fix_age_s + *h.correction_age_s;
  }
  if (plan != nullptr) facts.place_refused = take_off_refused(*plan, mission);
  facts.writable = ground.storage.writable;
  facts.disk_free_bytes = static_cast<double>(ground.storage.disk_free_bytes);
  auto items = make_checklist(facts);
  if (plan != nullptr && !manual && deps.drone != nullptr) {
    if (auto fence = fence_item(*plan)) items.push_back(std::move(*fence));
  }
  if (const auto it = said.find(mission); it != said.end()) {
    for (auto& i : items) {
      const auto found = it->second.find(i.id);
      if (found == it->second.end() || !i.overridable) continue;
      i.overridden_by = found->second.who;
      i.override_reason = found->second.reason;
    }
  }
  return items;
}

/// Judged as the flight itself will be; absent where nothing is known to judge by.
std::optional<std::string> FlightService::State::take_off_refused(const Plan& plan,
                                                                  const MissionId& mission) const {
  const auto it = heard.find(mission);
  if (it == heard.end() || !it->second.fix || it->second.fix->frame != TrackFrame::wgs84) return std::nullopt;
  const auto flown = flown_plan(plan, it->second.fix->position.height_m);
  if (!flown) return flown.error().message;
  const Eigen::Vector3d here = EnuFrame(*flown.value().origin).enu_from_wgs84(it->second.fix->position).m;
  const auto setup = procedure::flight_setup(flown.value(), here);
  if (!setup) return setup.error().message;
  const auto refused = procedure::refuse_take_off(setup.value().limits.bounds, here,
                                                  procedure::take_off_height_m(setup.value()));
  return refused ? refused->text : std::string{};
}

Result<FlightCommand> FlightService::State::begin(const Mission& mission, const Groundwork& ground,
                                                  bool manual, const Principal& who) {
  const Plan& plan = *ground.plan;
  manual = manual || deps.drone == nullptr;
  if (flight && flight->flying()) return forbidden("a flight is in the air already");
  const bool in_air = !manual && deps.drone->status().in_air;
  std::optional<Wgs84> took_off_from;
  if (in_air) {
    if (const auto* before = flight_of(mission.id))
      took_off_from = before->frame.wgs84_from_enu(Enu{before->home_m});
    if (!took_off_from)
      return forbidden("the aircraft is in the air and it is not known where it took off: land it first");
  }
  if (mission.frame != TrackFrame::wgs84)
    return forbidden("a mission in a local frame cannot be flown: an aircraft needs the globe");
  preparing.emplace(mission.id, plan);
  std::string open;
  for (const auto& i : checklist(&mission, mission.id, ground, manual)) {
    if (!i.green()) open += (open.empty() ? "" : ", ") + i.id;
  }
  if (!open.empty()) return forbidden("the checklist is not green: " + open);
  const auto& h = heard[mission.id];
  if (!h.fix || h.fix->frame != TrackFrame::wgs84) return forbidden("it is not known where the aircraft is");
  BOOST_OUTCOME_TRY(const Plan flown,
                    flown_plan(plan, (took_off_from ? *took_off_from : h.fix->position).height_m));
  const EnuFrame frame(*flown.origin);
  const Eigen::Vector3d here = frame.enu_from_wgs84(h.fix->position).m;
  // Home is on the ground: where this mission took off, when it starts again in the air.
  const Eigen::Vector3d home = took_off_from ? frame.enu_from_wgs84(*took_off_from).m : here;
  BOOST_OUTCOME_TRY(auto setup, procedure::flight_setup(flown, home));
  const double now = now_s();
  // A new flight is a new object, and so is what the link knows of it.
  flight.emplace(mission.id, flown, manual, frame, home,
                 procedure::FlightControl(std::move(setup), frame, manual ? nullptr : deps.drone));
  auto& f = *flight;
  if (ground.check) f.forecast = ground.check->time;
  f.control.fix(now, here, h.fix->fix);
  if (manual) {
    f.by_hand.position_m = here, f.former_s = now;
    f.control.by_hand(now, f.by_hand);
  }
  by_drone_number.clear();
  unconfirmed.reset();
  const auto number_of_start = note(mission.id, "start", who.name, "sent").number;
  f.control.start(now, who.name);
  note_dispatched(f, find(number_of_start));
  tell_happenings(f);
  said.erase(mission.id);  // of the next flight every item is asked again
  return *find(number_of_start);
}

/// Whatever the server believes: who has control can always tell the aircraft to hold, to land, to disarm.
Result<FlightCommand> FlightService::State::obey_directly(const MissionId& mission, const std::string& action,
                                                          const Principal& who) {
  auto& command = note(mission, action, who.name, "sent");
  if (deps.drone == nullptr) {
    command.state = "accepted", command.text = "shown to the pilot";
    return command;
  }
  if (flight && flight->flying() && !flight->manual && flight->control.taken_over()) deps.drone->take_back();
  by_drone_number[action == "hold"   ? deps.drone->hold()
                  : action == "land" ? deps.drone->land()
                                     : deps.drone->disarm()] = command.number;
  return command;
}

Result<FlightCommand> FlightService::State::obey(const MissionId& mission, const std::string& action,
                                                 const Principal& who) {
  const bool flies = flight_of(mission) && flight->flying();
  const bool always = action == "hold" || action == "land" || action == "disarm";
  if (action == "disarm" || (always && !flies)) return obey_directly(mission, action, who);
  if (!flies) return forbidden("this mission is not being flown");
  auto& f = *flight;
  if (action == "abort") {
    auto& command = note(mission, action, who.name, "sent");
    if (f.manual)
      command.state = "accepted";
    else
      by_drone_number[f.control.abort()] = command.number;
    f.aborted = "aborted by " + who.name + ": the aircraft is the pilot's";
    f.aborted_s = now_s();
    deps.events.add("warning", "procedure.aborted", f.aborted, mission);
    return command;
  }
  const auto event = event_of_action(action);
  if (!event) return forbidden("there is no action " + action);
  const auto number_of_order = note(mission, action, who.name, "sent").number;
  if (const auto why_not = f.control.command(now_s(), *event, who.name); !why_not.empty()) {
    std::erase_if(commands, [&](const FlightCommand& c) { return c.number == number_of_order; });
    return forbidden(action + ": " + why_not);
  }
  note_dispatched(f, find(number_of_order));
  tell_happenings(f);
  return *find(number_of_order);
}

namespace {

/// System 0 where it is not said: whoever is heard first.
DroneIdentity aircraft_of(const nlohmann::json& stored) {
  if (!stored.is_object()) return {};
  return {stored.value("peer", ""), stored.value("system", 0), stored.value("component", 0)};
}

}  // namespace

void FlightService::State::recover() {
  const auto kept = deps.plans.procedures();
  if (!kept) return;
  std::vector<std::pair<MissionId, nlohmann::json>> flying;
  for (const auto& [mission, text] : kept.value()) {
    auto j = nlohmann::json::parse(text, nullptr, false);
    if (j.is_object() && j.value("landed", false)) continue;
    deps.missions.prepare(mission);
    deps.missions.tell_clues(
        mission, j.is_object() ? clues_of(j.value("clues", nlohmann::json())) : procedure::FlightClues{});
    flying.emplace_back(mission, std::move(j));
  }
  const std::scoped_lock lock(mutex);
  for (const auto& [mission, j] : flying) {
    std::vector<FieldError> errors;
    const bool whole = j.is_object() && j.contains("plan") && j.contains("state") && j.contains("origin") &&
                       j.contains("home_m") && j["origin"].size() == 3 && j["home_m"].size() == 3;
    const auto state = whole ? state_of(j["state"]) : std::nullopt;
    Plan plan = whole ? read_plan(j["plan"], errors) : Plan{};
    if (!state || !errors.empty()) {
      deps.events.add("critical", "procedure.lost",
                      "the flight before the restart cannot be read: the pilot has it", mission);
      continue;
    }
    if (const auto id = parse_uuid(j.value("plan_id", ""))) plan.id = PlanId{id.value()};
    plan.version = j.value("plan_revision", 1ULL);
    const Wgs84 origin{j["origin"][0], j["origin"][1], j["origin"][2]};
    plan.origin = origin;
    const Eigen::Vector3d home(j["home_m"][0].get<double>(), j["home_m"][1].get<double>(),
                               j["home_m"][2].get<double>());
    auto setup = procedure::flight_setup(plan, home);
    if (!setup) continue;
    const bool manual = j.value("manual", false) || deps.drone == nullptr;
    // Before the flight, which is a new one on the link.
    const auto aircraft = aircraft_of(j.value("aircraft", nlohmann::json()));
    if (!manual && aircraft.system > 0) deps.drone->expect(aircraft);
    flight.emplace(mission, std::move(plan), manual, EnuFrame(origin), home,
                   procedure::FlightControl(std::move(setup).value(), EnuFrame(origin),
                                            manual ? nullptr : deps.drone, *state, now_s()));
    flight->clues_before = clues_of(j.value("clues", nlohmann::json()));
    if (const auto check = planning::check_plan(flight->plan)) flight->forecast = check.value().time;
    // Not heard yet: whether the hold leaves is decided by the mode that the first heartbeat shows.
    tell_happenings(*flight);
    deps.events.add("critical", "procedure.restarted",
                    "server restarted in flight: hold commanded, waiting for the operator", mission);
  }
}

nlohmann::ordered_json FlightService::State::procedure(const ActiveFlight& f) const {
  ProcedureView v;
  v.mission = f.mission;
  v.plan = f.plan.id.uuid == Uuid{} ? "" : to_string(f.plan.id);
  v.name = f.plan.name;
  v.plan_revision = f.plan.version;
  v.mode = f.manual ? "manual" : "auto";
  v.status = f.status();
  v.ended = f.ended();
  v.forecast = f.forecast;
  v.t_us = deps.clock.now().us();
  v.now_s = f.aborted.empty() ? now_s() : f.aborted_s;
  if (!f.manual) v.drone = deps.drone->status();
  v.shift_m = f.control.shift_m();
  if (const auto held = lease.holder(moment())) {
    v.holder = held->name;
    v.holder_since_us = held->since.us();
    v.holder_until_us = held->until.us();
  }
  for (const auto& c : commands) {
    if (c.mission == f.mission) v.commands.push_back(c);
  }
  if (v.commands.size() > k_shown_commands)
    v.commands.erase(v.commands.begin(), v.commands.end() - k_shown_commands);
  return procedure_json(v, f.control.engine(), f.frame);
}

void FlightService::State::publish_soon() {
  if (flight) flight->shown_s = -10;
}

/// The stepper once a second and with every transition, decisions once, profiles while they grow.
void FlightService::State::publish() {
  if (!flight) return;
  auto& f = *flight;
  const double now = now_s();
  const auto n = f.control.engine().state().n_transitions;
  const std::int64_t t_us = deps.clock.now().us();
  const auto key = to_string(f.mission);
  const bool moved = n != f.shown;
  if (moved || now - f.shown_s >= 1) {
    deps.hub.publish(Topic::procedure, to_wire(procedure(f)), t_us, key);
    f.shown_s = now;
  }
  const auto step = f.control.engine().state().step;
  const bool turning = step == procedure::Step::turn, climbing = step == procedure::Step::height_search;
  if (turning || climbing || moved) {
    for (const auto& [anchor, clues] : f.control.engine().clues()) {
      if (!clues.turn.empty() && (turning || moved))
        deps.hub.publish(Topic::mission_turn, to_wire(turn_json(f.mission, anchor, t_us, clues, turning)),
                         t_us, key + to_string(anchor), anchor);
      if (!clues.heights.empty() && (climbing || moved))
        deps.hub.publish(Topic::mission_height,
                         to_wire(height_json(f.mission, anchor, t_us, clues, climbing)), t_us,
                         key + to_string(anchor), anchor);
    }
  }
  if (moved && f.control.engine().decision())
    deps.hub.publish(Topic::mission_grid, to_wire(grid_json(f.mission, t_us, f.control.engine(), f.frame)),
                     t_us, key);
  f.shown = n;
}

std::vector<std::pair<std::string_view, std::string>> FlightService::State::alarms() const {
  const bool flying = flight && flight->flying();
  std::vector<std::pair<std::string_view, std::string>> out;
  for (const auto id : k_flight_alarms) {
    const auto& alarm = flying ? flight->control.engine().alarm() : std::nullopt;
    out.emplace_back(id, alarm && alarm->id == id ? alarm->text : "");
  }
  out.emplace_back("drone.taken_over",
                   flying && flight->control.taken_over() ? "the pilot or a failsafe has the aircraft" : "");
  // Until the next flight, or until somebody says that he knows.
  const bool failed = flight && flight->status() == "aborted" && flight->aborted.empty() &&
                      !flight->control.engine().state().by_person;
  out.emplace_back("flight.aborted", failed ? "the flight ended before its end: " + flight->ended() : "");
  std::string silent;
  for (const auto& c : commands) {
    if (flying && unconfirmed && c.number == *unconfirmed) silent = c.action + " " + c.state + ": " + c.text;
  }
  out.emplace_back("cmd.unconfirmed", std::move(silent));
  std::string stale;
  if (flying && !flight->manual && deps.drone != nullptr) {
    for (const auto& name : deps.drone->status().stale) stale += (stale.empty() ? "" : ", ") + name;
    if (!stale.empty()) stale = "no telemetry for 5 s although the autopilot answers: " + stale;
  }
  out.emplace_back("drone.telemetry", std::move(stale));
  return out;
}

}  // namespace anchord::api
