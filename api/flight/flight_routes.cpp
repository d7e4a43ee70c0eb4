#include <array>
#include <charconv>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/flight/flight_service.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/flight/routes.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_service.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/procedure_log.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

using flight::ControlAction;
using flight::k_control_words;
constexpr std::array<std::string_view, 2> k_lists{"fence", "route"};

Ordered lease_json(const Lease& lease, bool with_key) {
  Ordered out{{"held", true},
              {"mission", to_string(lease.mission)},
              {"holder", lease.name},
              {"since_us", lease.since.us()},
              {"expires_us", lease.until.us()}};
  if (with_key) out["lease"] = lease.key;
  return out;
}

/// Control that is missing is a 409 of its own, so that a screen can offer to take it.
template <class T>
T granted(Result<T> result) {
  if (!result && result.error().code == Errc::conflict)
    throw_problem(409, "no-control", result.error().message);
  return value_or_problem(std::move(result));
}

/// Of who is bound to sites: whether the lease is of a mission that they do not see.
bool elsewhere(FlightApi& s, const std::optional<Lease>& lease) {
  return lease && !current_sites().all() && !s.missions.missions.mission(lease->mission);
}

/// Asking changes nothing: the holder's screen shows the event, and gives control back or refuses.
Response ask_for_control(FlightApi& s, const Request& request, const MissionId& mission) {
  const auto lease = s.flights.control();
  if (!lease || lease->mission != mission)
    throw_problem(409, "no-control", "nobody has control of this mission: take control first (action take)");
  const std::string text = request.principal.name + " asks " + lease->name + " for control";
  s.events.add(EventLevel::warning, "control.asked", text, mission);
  return json_response(200, lease_json(*lease, false));
}

Response control(FlightApi& s, const Request& request) {
  const auto mission = named_mission(s.missions, request).id;
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto action = fields.word("action", k_control_words, true);
  const bool needs_lease = action && action != ControlAction::take && action != ControlAction::ask;
  const auto key = fields.text("lease", 64, needs_lease);
  const bool by_force = fields.boolean("force").value_or(false);
  fields.finish();
  refuse_if_any(errors);
  refuse_elsewhere(s, action == ControlAction::take);
  const auto done =
      std::string("control.") + std::string(k_control_words.word(*action)) + ' ' + to_string(mission);
  if (action == ControlAction::take) {
    const auto lease = granted(s.flights.take_control(mission, request.principal, by_force));
    s.audit.soon(request, done + (by_force ? " by force" : ""));
    return json_response(200, lease_json(lease, true));
  }
  if (action == ControlAction::ask) {
    auto asked = ask_for_control(s, request, mission);
    s.audit.soon(request, done);
    return asked;
  }
  if (action == ControlAction::refuse) {
    const auto lease = granted(s.flights.renew_control(mission, *key, request.principal));
    s.events.add(EventLevel::info, "control.refused", lease.name + " keeps control", mission);
    s.audit.soon(request, done);
    return json_response(200, lease_json(lease, true));
  }
  if (action == ControlAction::renew)
    return json_response(
        200, lease_json(granted(s.flights.renew_control(mission, *key, request.principal)), true));
  granted(s.flights.release_control(mission, *key, request.principal));
  s.audit.soon(request, done);
  return json_response(200, Ordered{{"held", false}});
}

Response who_has_control(FlightApi& s, const Request& request) {
  check_query(request, {});
  named_mission(s.missions, request);
  const auto lease = s.flights.control();
  return json_response(200,
                       lease && !elsewhere(s, lease) ? lease_json(*lease, false) : Ordered{{"held", false}});
}

/// The plan that the body of a command names; nothing where it names none, which is an error of its fields.
std::optional<PlanId> plan_of(Fields& fields) {
  const auto text = fields.text("plan", 36, true);
  if (!text) return std::nullopt;
  const auto id = parse_uuid(*text);
  if (id) return PlanId{id.value()};
  fields.error("plan", "bad_id", id.error().message);
  return std::nullopt;
}

Response checklist(FlightApi& s, const Request& request) {
  check_query(request, {"plan"});
  const auto mission = named_mission(s.missions, request).id;
  std::optional<PlanId> plan;
  if (const auto text = request.query_value("plan")) {
    const auto id = parse_uuid(*text);
    if (!id) throw_problem(422, "validation", "plan is not an id", {{"/plan", "bad_id", id.error().message}});
    plan = PlanId{id.value()};
  }
  return json_response(200, checklist_json(s.flights.checklist(mission, plan)));
}

Response work_off_checklist(FlightApi& s, const Request& request) {
  check_query(request, {});
  const auto mission = named_mission(s.missions, request).id;
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto plan = plan_of(fields);
  fields.finish();
  refuse_if_any(errors);
  value_or_problem(s.flights.prepare(mission, *plan));
  s.audit.soon(request, "checklist " + to_string(mission) + " plan " + to_string(*plan));
  return json_response(200, checklist_json(s.flights.checklist(mission, *plan)));
}

Response override_item(FlightApi& s, const Request& request) {
  const auto mission = named_mission(s.missions, request).id;
  const auto item = request.params.at("item");
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto reason = fields.text("reason", 300, true);
  fields.finish();
  if (errors.empty() && reason->empty()) errors.push_back({"/reason", "out_of_range", "must not be empty"});
  refuse_if_any(errors);
  value_or_problem(s.flights.override_item(mission, item, *reason, request.principal));
  s.audit(request, "checklist." + item + ' ' + to_string(mission) + ": " + *reason);
  return json_response(200, checklist_json(s.flights.checklist(mission, std::nullopt)));
}

Response shown(FlightApi& s, const Request& request, std::string (FlightService::*text)(const MissionId&)) {
  check_query(request, {});
  const auto mission = named_mission(s.missions, request).id;
  Response response;
  response.body = (s.flights.*text)(mission);
  if (response.body.empty())
    throw_problem(404, "not-found", "this mission has not been flown since the server started");
  response.header("Content-Type", "application/json");
  return response;
}

Response profiles(FlightApi& s, const Request& request,
                  std::vector<std::string> (FlightService::*texts)(const MissionId&)) {
  check_query(request, {});
  const auto mission = named_mission(s.missions, request).id;
  Response response;
  for (const auto& one : (s.flights.*texts)(mission))
    response.body += (response.body.empty() ? "" : ",") + one;
  response.body = "{\"items\":[" + response.body + "]}";
  response.header("Content-Type", "application/json");
  return response;
}

/// The part of POST /missions/{id}/actions that moves an aircraft. Whatever it answers is in the audit log.
Response act_in_flight(FlightApi& s, const Request& request, const std::string& word, Fields& fields,
                       std::vector<FieldError>& errors) {
  const auto mission = path_id<MissionId>(request);
  FlightService::Order order;
  order.action = value_or_problem(flight::k_flight_action_words.parse("action", word));
  order.lease = fields.text("lease", 64).value_or("");
  if (order.action == flight::FlightAction::start) {
    order.plan = plan_of(fields);
    order.manual = fields.word("mode", flight::k_flight_mode_words).value_or(false);
  }
  fields.finish();
  refuse_if_any(errors);
  refuse_elsewhere(s);
  const std::string what = "mission." + word + ' ' + to_string(mission);
  auto command = s.flights.act(mission, order, request.principal);
  if (!command) {
    s.audit.soon(request, what, "refused: " + command.error().message);
    if (command.error().code == Errc::invalid_argument) throw_problem(422, "state", command.error().message);
  }
  auto given = granted(std::move(command));
  s.audit.soon(request, what);
  if (const int wait_s = prefer_wait_s(request); wait_s > 0)
    given = s.flights.settled(std::move(given), std::min(wait_s, 3));
  return json_response(202, flight_command_json(given));
}

/// The aircraft's own lists. What is asked for is in the audit log, as every command.
Response upload(FlightApi& s, const Request& request) {
  const auto mission = named_mission(s.missions, request).id;
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto what = fields.word("what", k_lists, true);
  const auto lease = fields.text("lease", 64).value_or("");
  const auto plan = plan_of(fields);
  fields.finish();
  refuse_if_any(errors);
  refuse_elsewhere(s);
  const std::string& list = *what;
  const std::string audited = "mission.upload " + list + ' ' + to_string(mission);
  auto command = s.flights.upload(mission, list, *plan, lease, request.principal);
  if (!command) {
    s.audit(request, audited, "refused: " + command.error().message);
    if (command.error().code == Errc::invalid_argument) throw_problem(422, "state", command.error().message);
  }
  auto given = granted(std::move(command));
  s.audit(request, audited);
  if (const int wait_s = prefer_wait_s(request); wait_s > 0)
    given = s.flights.settled(std::move(given), std::min(wait_s, 20));
  return json_response(202, flight_command_json(given));
}

Response uploads(FlightApi& s, const Request& request) {
  check_query(request, {});
  const auto mission = named_mission(s.missions, request).id;
  auto items = Ordered::array();
  for (const auto& one : s.flights.uploads(mission)) items.push_back(flight_upload_json(one));
  return json_response(200, Ordered{{"items", std::move(items)}});
}

/// Another aircraft on the link. Whatever it answers is in the audit log.
Response change_aircraft(FlightApi& s, const Request& request) {
  const auto mission = named_mission(s.missions, request).id;
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto lease = fields.text("lease", 64).value_or("");
  const auto sender = fields.text("sender", 100).value_or("");
  fields.finish();
  refuse_if_any(errors);
  refuse_elsewhere(s);
  const std::string audited = "mission.aircraft " + to_string(mission) + (sender.empty() ? "" : " " + sender);
  auto changed = s.flights.change_aircraft(mission, lease, sender, request.principal);
  if (!changed) {
    s.audit(request, audited, "refused: " + changed.error().message);
    if (changed.error().code == Errc::invalid_argument) throw_problem(422, "state", changed.error().message);
  }
  const auto status = granted(std::move(changed));
  s.audit(request, audited);
  return json_response(200, drone_json(status));
}

/// A cursor is the number of the last entry before.
std::uint64_t entry_number(const std::string& cursor) {
  std::uint64_t number = 0;
  if (cursor.empty()) return number;
  const auto [end, fault] = std::from_chars(cursor.data(), cursor.data() + cursor.size(), number);
  if (fault != std::errc{} || end != cursor.data() + cursor.size())
    throw_problem(422, "validation", "cursor was not issued by this server",
                  {{"/cursor", "bad_cursor", "was not issued by this server"}});
  return number;
}

/// Oldest first.
Response procedure_log(FlightApi& s, const Request& request) {
  check_query(request, {"limit", "cursor"});
  const auto mission = named_mission(s.missions, request).id;
  const auto page = page_query(request);
  const auto after = entry_number(page.cursor);
  auto entries = value_or_problem(s.procedure_log.entries(mission, page.limit + 1, after));
  std::size_t bytes = 0;
  for (const auto& one : entries) bytes += one.entry.message_json.size();
  const bool full = entries.size() > page.limit;
  if (full) entries.pop_back();
  Ordered items = Ordered::array();
  for (const auto& [number, entry] : entries)
    items.push_back({{"t_us", entry.time.us()},
                     {"topic", entry.topic},
                     {"data", Ordered::parse(entry.message_json, nullptr, false)}});
  const bool more = full || bytes >= ProcedureLog::k_page_bytes;
  return list_response(request, std::move(items), more ? std::to_string(entries.back().number) : "");
}

}  // namespace

void refuse_elsewhere(FlightApi& s, bool taking) {
  const auto lease = s.flights.control();
  if (elsewhere(s, lease) && !(taking && !s.flights.flies(lease->mission)))
    throw_problem(409, "no-control",
                  "the aircraft is commanded for another site: ask whoever runs this server");
}

FlightActions flight_actions(FlightApi& s) {
  const auto words = flight::k_flight_action_words.words();
  return {
      {words.begin(), words.end()},
      [&s](const Request& request, const std::string& action, Fields& fields,
           std::vector<FieldError>& errors) { return act_in_flight(s, request, action, fields, errors); }};
}

void add_flight_routes(Router& router, FlightApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto op = Access::any_of({Role::op});
  const std::string base = "/api/v1/missions/{id}/";
  router.add(as_command({Method::get, base + "control", readers(), on(who_has_control)}));
  router.add(keeps_always(as_command({Method::post, base + "control", op, on(control), k_command_bytes})));
  router.add({Method::get, base + "uploads", readers(), on(uploads)});
  router.add(keeps_always(as_flight({Method::post, base + "uploads", op, on(upload), k_command_bytes})));
  router.add(
      keeps_always(as_flight({Method::post, base + "aircraft", op, on(change_aircraft), k_command_bytes})));
  router.add(as_flight({Method::get, base + "checklist", readers(), on(checklist)}));
  router.add(keeps_always(
      as_flight({Method::post, base + "checklist", op, on(work_off_checklist), k_command_bytes})));
  router.add(keeps_always(
      as_flight({Method::post, base + "checklist/{item}", op, on(override_item), k_command_bytes})));
  router.add({Method::get, base + "procedure", readers(),
              [&s](const Request& request) { return shown(s, request, &FlightService::procedure_text); }});
  router.add({Method::get, base + "grid", readers(),
              [&s](const Request& request) { return shown(s, request, &FlightService::grid_text); }});
  router.add(as_heavy({Method::get, base + "procedure-log", readers(), on(procedure_log)}));
  router.add({Method::get, base + "turns", readers(),
              [&s](const Request& request) { return profiles(s, request, &FlightService::turn_texts); }});
  router.add({Method::get, base + "height-searches", readers(),
              [&s](const Request& request) { return profiles(s, request, &FlightService::height_texts); }});
}

}  // namespace anchord::api
