#include <nlohmann/json.hpp>

#include "api/json/reader.hpp"
#include "api/json/wire_resources.hpp"
#include "api/json/wire_rows.hpp"
#include "api/routes/routes.hpp"
#include "api/routes/support.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

Ordered with_counts(Services& s, const Mission& mission) {
  return mission_json(mission, value_or_problem(s.deps.measurements.count_ranges(mission.id)),
                      value_or_problem(s.deps.measurements.count_fixes(mission.id)));
}

Response list(Services& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  const auto page = page_query(request);
  auto rows = value_or_problem(s.deps.missions.missions(page.limit + 1, cursor_id<MissionId>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& mission : rows) items.push_back(with_counts(s, mission));
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
}

Response create(Services& s, const Request& request) {
  std::vector<FieldError> errors;
  Mission mission = read_mission(json_body(request), errors);
  if (mission.site && !s.deps.anchors.site(*mission.site))
    errors.push_back({"/site", "unknown_site", "there is no such site"});
  refuse_if_any(errors);
  mission.created = s.deps.clock.now();
  mission.id.uuid = make_uuid_v7(mission.created);
  const bool with_devices = !request.query_value("devices") || query_flag(request, "devices");
  value_or_problem(s.missions.create(mission));
  // A local frame has no place for a rover's positions.
  if (s.deps.devices != nullptr && with_devices && mission.frame == TrackFrame::wgs84)
    s.deps.devices->record_into(mission.id);
  s.audit(request, "mission.create " + to_string(mission.id));
  Response response = json_response(201, mission_json(mission, 0, 0));
  response.header("Location", "/api/v1/missions/" + to_string(mission.id));
  return response;
}

Response act(Services& s, const Request& request) {
  const auto id = path_id<MissionId>(request);
  value_or_problem(s.missions.mission(id));
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  std::vector<std::string_view> actions{"finish"};
  if (s.flights != nullptr) actions.insert(actions.end(), flight_actions().begin(), flight_actions().end());
  const auto action = fields.word("action", actions, true);
  if (action.value_or(0) > 0) return flight_action(s, request, std::string(actions[*action]), fields, errors);
  fields.finish();
  refuse_if_any(errors);
  const auto finished = s.missions.finish(id);
  if (!finished && finished.error().code == Errc::conflict)
    throw_problem(422, "state", finished.error().message);
  auto mission = value_or_problem(finished);
  if (s.deps.devices != nullptr && s.deps.devices->recording_into() == id) s.deps.devices->record_into({});
  s.audit(request, "mission.finish " + to_string(id));
  return json_response(200, with_counts(s, mission));
}

Response events(Services& s, const Request& request) {
  check_query(request, {"limit", "since", "mission"});
  std::optional<MissionId> mission = query_mission(request);
  if (request.params.count("id") > 0) {
    mission = path_id<MissionId>(request);
    value_or_problem(s.missions.mission(*mission));
  }
  Ordered items = Ordered::array();
  for (const auto& event : s.events.newest(page_query(request).limit, mission, query_time(request, "since")))
    items.push_back(Ordered::parse(event_json(event)));
  return list_response(request, std::move(items), "");
}

/// The flown way as one GeoJSON line (in a local frame as local_m), a page of at most 10 000 points.
Response track(Services& s, const Request& request) {
  check_query(request, {"limit", "cursor", "since", "until"});
  const auto id = path_id<MissionId>(request);
  const auto mission = value_or_problem(s.missions.mission(id));
  const auto page = page_query(request, 10'000);
  MeasurementStore::Filter filter;
  filter.mission = id;
  filter.limit = page.limit;
  filter.after = page.cursor;
  filter.since = query_time(request, "since");
  filter.until = query_time(request, "until");
  const auto rows = value_or_problem(s.deps.measurements.fixes(filter));
  Ordered line = Ordered::array(), local = Ordered::array(), t_us = Ordered::array(), fix = Ordered::array();
  for (const auto& row : rows.rows) {
    if (row.frame == TrackFrame::wgs84)
      line.push_back({row.position.lon_deg, row.position.lat_deg, row.position.height_m});
    else
      local.push_back({row.local_m.x(), row.local_m.y(), row.local_m.z()});
    t_us.push_back(row.time.us());
    fix.push_back(fix_word(row.fix));
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

void add_mission_routes(Router& router, Services& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  router.add({Method::get, "/api/v1/missions", readers(), on(list)});
  router.add({Method::post, "/api/v1/missions", Access::any_of({Role::op}), on(create)});
  router.add({Method::get, "/api/v1/missions/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return json_response(
                    200, with_counts(s, value_or_problem(s.missions.mission(path_id<MissionId>(request)))));
              }});
  router.add({Method::del, "/api/v1/missions/{id}", Access::any_of({Role::op}), [&s](const Request& request) {
                const auto id = path_id<MissionId>(request);
                value_or_problem(s.missions.remove(id));
                s.audit(request, "mission.delete " + to_string(id));
                Response response;
                response.status = 204;
                return response;
              }});
  Route actions{Method::post, "/api/v1/missions/{id}/actions", Access::any_of({Role::op}), on(act),
                k_command_bytes};
  actions.work_of = work_of_action;
  router.add(std::move(actions));
  router.add({Method::get, "/api/v1/missions/{id}/events", readers(), on(events)});
  router.add(as_heavy({Method::get, "/api/v1/missions/{id}/track", readers(), on(track)}));
  router.add({Method::get, "/api/v1/events", readers(), on(events)});
}

}  // namespace anchord::api
