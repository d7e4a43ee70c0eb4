#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/measurements/routes.hpp"
#include "api/missions/mission_service.hpp"
#include "api/wire/exclusion_json.hpp"
#include "core/ports/exclusion_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

Response list(MeasurementApi& s, const Request& request) {
  check_query(request, {"fields"});
  const auto mission = path_id<MissionId>(request);
  value_or_problem(s.missions.mission(mission));
  Ordered items = Ordered::array();
  for (const auto& one : value_or_problem(s.exclusions.exclusions(mission)))
    items.push_back(exclusion_json(one));
  return list_response(request, std::move(items), "");
}

std::string words(const Exclusion& e) {
  return std::to_string(e.n_rows) + (e.selection.kind == RowKind::ranges ? " ranges" : " positions");
}

Response exclude(MeasurementApi& s, const Request& request) {
  check_query(request, {});
  const auto mission = path_id<MissionId>(request);
  value_or_problem(s.missions.mission(mission));
  std::vector<FieldError> errors;
  auto wanted = read_exclusion_request(json_body(request), errors);
  refuse_if_any(errors);
  Exclusion e;
  e.created = s.clock.now();
  e.id.uuid = make_uuid_v7(e.created);
  e.mission = mission;
  e.selection = std::move(wanted.selection);
  e.reason = std::move(wanted.reason);
  e.by = request.principal.name;
  auto stored = s.exclusions.insert(e, wanted.ids);
  if (!stored && stored.error().code == Errc::not_found)
    throw_problem(422, "validation", stored.error().message,
                  {{wanted.ids.empty() ? "/since" : "/ids", "no_row", stored.error().message}});
  const auto done = value_or_problem(std::move(stored));
  s.audit(request, "rows.exclude " + to_string(mission) + ' ' + to_string(done.id) + ' ' + words(done) +
                       " reason: " + done.reason);
  s.missions.exclusions_changed(mission);
  s.events.add(EventLevel::info, "rows.excluded",
               words(done) + " excluded by " + done.by + ": " + done.reason, mission);
  Response response = json_response(201, exclusion_json(done));
  response.header("Location", "/api/v1/missions/" + to_string(mission) + "/exclusions");
  return response;
}

Response include(MeasurementApi& s, const Request& request) {
  check_query(request, {});
  const auto mission = path_id<MissionId>(request);
  const auto id = path_id<ExclusionId>(request, "exclusion");
  const auto reason = optional_reason(request);
  const auto done =
      value_or_problem(s.exclusions.include(mission, id, {s.clock.now(), request.principal.name, reason}));
  s.audit(request, "rows.include " + to_string(mission) + ' ' + to_string(id) + ' ' + words(done) +
                       (reason.empty() ? "" : " reason: " + reason));
  s.missions.exclusions_changed(mission);
  s.events.add(EventLevel::info, "rows.included", words(done) + " are used again, by " + done.included->by,
               mission);
  return json_response(200, exclusion_json(done));
}

}  // namespace

void add_exclusion_routes(Router& router, MeasurementApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto operators = Access::any_of({Role::op, Role::engineer});
  const std::string base = "/api/v1/missions/{id}/exclusions";
  router.add({Method::get, base, readers(), on(list)});
  router.add({Method::post, base, operators, on(exclude), 2 << 20});
  router.add({Method::post, base + "/{exclusion}/include", operators, on(include)});
}

}  // namespace anchord::api
