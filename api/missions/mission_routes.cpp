#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/flight_events.hpp"
#include "api/devices/device_stream.hpp"
#include "api/kit/content_tag.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/date_line.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/row_cursor.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_control.hpp"
#include "api/missions/mission_json.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/routes.hpp"
#include "api/wire/rows_json.hpp"
#include "core/flight/command.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

Response binned_missions(MissionApi& services, const Request& request);
Response binned_mission(MissionApi& services, const Request& request);

namespace {

constexpr std::string_view k_finish = "finish", k_take_devices = "take_devices";
constexpr std::string_view k_start = flight::k_flight_action_words.word(flight::FlightAction::start);

/// Whether who asks may see this mission.
bool sees(MissionApi& s, const MissionId& mission) {
  return current_sites().all() || s.missions.mission(mission).has_value();
}

/// Whether it has the rows of this server's devices, and who has them instead; absent: there are none.
void say_devices(MissionApi& s, const Mission& mission, Ordered& out) {
  const auto holder = s.stream.holder();
  Ordered devices{{"recording", holder && holder->id == mission.id}, {"held_by", nullptr}};
  if (mission.state == MissionState::recording && holder && holder->id != mission.id && sees(s, holder->id))
    devices["held_by"] = Ordered{{"mission", to_string(holder->id)}, {"name", holder->name}};
  out["devices"] = std::move(devices);
}

Ordered with_counts(MissionApi& s, const Mission& mission) {
  auto out = mission_json(mission, value_or_problem(s.measurements.count_ranges(mission.id)),
                          value_or_problem(s.measurements.count_fixes(mission.id)));
  say_devices(s, mission, out);
  return out;
}

Response list(MissionApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "deleted"});
  if (query_flag(request, "deleted")) return binned_missions(s, request);
  return id_page<MissionId>(
      request,
      [&](std::size_t limit, const std::optional<MissionId>& after) {
        return s.mission_store.missions(limit, after);
      },
      [&](const auto& mission) { return with_counts(s, mission); });
}

/// What a new mission wants of the devices, taken out of its body.
struct DevicesWanted {
  bool any{true};    ///< ?devices=false: an upload or a replay brings its own rows
  bool take{false};  ///< from a mission that has them
  std::string lease;
};
DevicesWanted read_devices_wanted(const Request& request, nlohmann::json& body,
                                  std::vector<FieldError>& errors) {
  DevicesWanted wanted;
  wanted.any = !request.query_value("devices") || query_flag(request, "devices");
  if (!body.is_object()) return wanted;
  nlohmann::json mine = nlohmann::json::object();
  for (const char* key : {"take_devices", "lease"}) {
    if (const auto at = body.find(key); at != body.end()) {
      mine[key] = *at;
      body.erase(at);
    }
  }
  Fields fields(mine, "", errors);
  wanted.take = fields.boolean("take_devices").value_or(false);
  wanted.lease = fields.text("lease", 64).value_or("");
  if (wanted.take && !wanted.any) fields.error("take_devices", "contradiction", "contradicts devices=false");
  return wanted;
}

/// Taking them from another mission is whoever commands that one's right.
void require_right_to_take(MissionApi& s, const Request& request, const MissionId& taker,
                           const std::string& lease) {
  const auto holder = s.stream.holder();
  if (!holder || holder->id == taker) return;
  if (!sees(s, holder->id))
    throw_problem(409, "no-control", "the devices record for another site: ask whoever runs this server");
  require_control(s, request, holder->id, lease,
                  holder->name + " (mission " + to_string(holder->id) +
                      ") is recording with the devices; to take them, send the lease of its control");
}

Response create(MissionApi& s, const Request& request) {
  std::vector<FieldError> errors;
  auto body = json_body(request);
  const auto wanted = read_devices_wanted(request, body, errors);
  Mission mission = read_mission(body, errors);
  mission.site = named_or_own(mission.site);
  if (mission.site && !s.sites.site(*mission.site))
    errors.push_back({"/site", "unknown_site", "there is no such site"});
  // A local frame has no place for a rover's positions.
  const bool records = wanted.any && mission.frame == TrackFrame::wgs84;
  if (wanted.take && !records && errors.empty())
    errors.push_back(
        {"/take_devices", "contradiction", "a mission in a local frame cannot record with the devices"});
  refuse_if_any(errors);
  mission.created = s.clock.now();
  mission.id.uuid = make_uuid_v7(mission.created);
  if (wanted.take) require_right_to_take(s, request, mission.id, wanted.lease);
  value_or_problem(s.missions.create(mission));
  if (wanted.take)
    s.stream.take(mission, request.principal.name);
  else if (records)
    s.stream.begin(mission);
  s.audit(request, "mission.create " + to_string(mission.id) + (wanted.take ? " taking the devices" : ""));
  Response response = mission_answer(s, 201, mission);
  response.header("Location", "/api/v1/missions/" + to_string(mission.id));
  return response;
}

Response finish(MissionApi& s, const Request& request, const MissionId& id, const std::string& lease) {
  if (s.control.flies(id))
    require_control(s, request, id, lease, "this mission is in the air; finishing it needs its lease");
  const auto finished = s.missions.finish(id);
  if (!finished && finished.error().code == Errc::conflict)
    throw_problem(422, "state", finished.error().message);
  const auto mission = value_or_problem(finished);
  s.stream.ended(id);
  s.audit(request, "mission.finish " + to_string(id));
  return mission_answer(s, 200, mission);
}

/// Rows of the devices for a mission that records without them: at once when nobody has them.
Response take_devices(MissionApi& s, const Request& request, const Mission& mission,
                      const std::string& lease) {
  if (mission.state != MissionState::recording)
    throw_problem(422, "state",
                  mission.name + " is not recording: only a mission that is recording can have the devices");
  if (mission.frame != TrackFrame::wgs84)
    throw_problem(422, "state",
                  mission.name + " is in a local frame: it cannot use the positions of a rover");
  require_right_to_take(s, request, mission.id, lease);
  s.stream.take(mission, request.principal.name);
  s.audit(request, "mission.take_devices " + to_string(mission.id));
  return mission_answer(s, 200, mission);
}

Response act(MissionApi& s, const Request& request) {
  const Mission mission = named_mission(s, request);
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  std::vector<std::string_view> actions{k_finish, k_take_devices};
  actions.insert(actions.end(), s.flight.words.begin(), s.flight.words.end());
  const auto action = fields.word("action", actions, true);
  if (action && *action != k_finish && *action != k_take_devices)
    return s.flight.act(request, *action, fields, errors);
  const auto lease = fields.text("lease", 64).value_or("");
  fields.finish();
  refuse_if_any(errors);
  return *action == k_finish ? finish(s, request, mission.id, lease)
                             : take_devices(s, request, mission, lease);
}

Ordered event_item(const LiveEvent& event) { return Ordered::parse(event_json(event)); }

/// The newest of this server since its start; those of one flight only, where the query names it.
Response events(MissionApi& s, const Request& request) {
  check_query(request, {"limit", "since", "mission"});
  Ordered items = Ordered::array();
  for (const auto& event :
       s.events.newest(page_query(request).limit, query_mission(request), query_time(request, "since")))
    items.push_back(event_item(event));
  return list_response(request, std::move(items), "");
}

/// All of a flight, also of before a restart.
Response mission_events(MissionApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "since"});
  const auto mission = named_mission(s, request).id;
  const auto since = query_time(request, "since");
  return id_page<EventId>(
      request,
      [&](std::size_t limit, const std::optional<EventId>& after) {
        return s.flight_events.newest(mission, limit, since, after);
      },
      event_item);
}

/// What an aircraft in the air is told must not wait behind what begins and ends flights, which reads the
/// disk and checks plans. A body that cannot be read is refused by either executor.
Work work_of_action(const Request& request) {
  const auto body = nlohmann::json::parse(request.body, nullptr, false);
  const auto action = body.is_object() ? body.value("action", nlohmann::json()) : nlohmann::json();
  return action == k_start || action == k_finish ? Work::flight : Work::command;
}

/// The flown way as one GeoJSON line (in a local frame as local_m), a page of at most 10 000 points.
Response estimates_over_time(MissionApi& s, const Request& request) {
  check_query(request, {});
  const auto text = s.missions.estimates_over_time(named_mission(s, request).id);
  if (!text)
    throw_problem(503, "storage", "the stored rows of this flight cannot be read at the moment: try again");
  Response response;
  response.body = *text;
  response.header("Content-Type", "application/json");
  return response;
}

Response track(MissionApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "since", "until"});
  const auto mission = named_mission(s, request);
  const auto id = mission.id;
  const auto page = page_query(request, 10'000);
  MeasurementStore::Filter filter;
  filter.mission = id;
  filter.limit = page.limit;
  filter.after = page.cursor;
  filter.since = query_time(request, "since");
  filter.until = query_time(request, "until");
  check_row_cursor(s.measurements, filter);
  const auto rows = value_or_problem(s.measurements.fixes(filter));
  Ordered line = Ordered::array(), local = Ordered::array(), t_us = Ordered::array(), fix = Ordered::array();
  std::optional<double> before_deg;
  for (const auto& row : rows.rows) {
    if (row.frame == TrackFrame::wgs84) {
      before_deg = beside(row.position.lon_deg, before_deg.value_or(row.position.lon_deg));
      line.push_back({*before_deg, row.position.lat_deg, row.position.height_m});
    } else {
      local.push_back({row.local_m.x(), row.local_m.y(), row.local_m.z()});
    }
    t_us.push_back(row.time.us());
    fix.push_back(k_fix_words.word(row.fix));
  }
  const bool globe = mission.frame == TrackFrame::wgs84;
  Ordered body{{"type", "Feature"}, {"id", to_string(id)}};
  body["geometry"] = globe && line.size() > 1
                         ? Ordered{{"type", "LineString"}, {"coordinates", std::move(line)}}
                         : Ordered(nullptr);
  body["properties"] = {{"mission", to_string(id)},
                        {"t_us", std::move(t_us)},
                        {"fix", std::move(fix)},
                        {"local_m", globe ? Ordered(nullptr) : std::move(local)}};
  body["next_cursor"] = rows.next.empty() ? Ordered(nullptr) : Ordered(rows.next);
  Response response = json_response(200, body, "application/geo+json");
  if (!rows.next.empty()) response.header("Link", next_link(request, rows.next));
  return response;
}

}  // namespace

Response mission_answer(MissionApi& s, int status, const Mission& mission) {
  auto body = with_counts(s, mission);
  body["flight_time"] = s.flight_time ? s.flight_time(mission.id) : Ordered(nullptr);
  Response response = json_response(status, body);
  response.header("ETag", content_tag(response.body, "m-"));
  return response;
}

std::string etag_of(const Response& mission_answer) {
  return std::ranges::find(mission_answer.headers, "ETag", [](const auto& h) { return h.first; })->second;
}

void add_mission_routes(Router& router, MissionApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  router.add({Method::get, "/api/v1/missions", readers(), on(list)});
  router.add({Method::post, "/api/v1/missions", Access::any_of({Role::op}), on(create)});
  router.add({Method::get, "/api/v1/missions/{id}", readers(), [&s](const Request& request) {
                check_query(request, {"deleted"});
                return query_flag(request, "deleted") ? binned_mission(s, request)
                                                      : mission_answer(s, 200, named_mission(s, request));
              }});
  Route actions{Method::post, "/api/v1/missions/{id}/actions", Access::any_of({Role::op}), on(act),
                k_command_bytes};
  actions.work_of = work_of_action;
  router.add(keeps_always(std::move(actions)));
  router.add({Method::get, "/api/v1/missions/{id}/events", readers(), on(mission_events)});
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/track", readers(), on(track)}));
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/estimates", readers(), on(estimates_over_time)}));
  router.add({Method::get, "/api/v1/events", readers(), on(events)});
}

}  // namespace anchord::api
