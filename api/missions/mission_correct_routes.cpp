#include <array>
#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_json.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/routes.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

/// What was typed when the mission began and may have been wrong. Not its frame: the rows are stored in it.
constexpr std::array k_corrected{"name", "site", "kit", "radio", "track_point", "tags", "lever_arm_sigma_m"};

/// The mission with what the body says of it (RFC 7396), and the names of what is another than before.
struct Corrected {
  Mission mission;
  std::string changed;
};
Corrected corrected(const Mission& before, const Json& body, std::vector<FieldError>& errors) {
  const Json now = mission_json(before, {}, {});
  Json declared{{"frame", now["frame"]}};
  for (const char* key : k_corrected) declared[key] = now[key];
  if (!body.is_object()) {
    errors.push_back({"", "wrong_type", "must be an object"});
    return {before, ""};
  }
  if (body.contains("frame") && body["frame"] != now["frame"])
    errors.push_back({"/frame", "fixed", "cannot be changed: the measurements are stored in it"});
  declared.merge_patch(body);
  Corrected out{read_mission(declared, errors), ""};
  out.mission.id = before.id;
  out.mission.state = before.state;
  out.mission.created = before.created;
  out.mission.finished = before.finished;
  const Json after = mission_json(out.mission, {}, {});
  for (const char* key : k_corrected)
    if (after[key] != now[key]) out.changed += (out.changed.empty() ? "" : ", ") + std::string(key);
  return out;
}

Response correct(MissionApi& s, const Request& request) {
  check_query(request, {});
  const Mission named = named_mission(s, request);
  const auto body = json_body(request);
  std::string changed;
  const auto after = value_or_problem(s.missions.correct(named.id, [&](const Mission& before) {
    require_match(request, etag_of(mission_answer(s, 200, before)));
    std::vector<FieldError> errors;
    auto [mission, names] = corrected(before, body, errors);
    mission.site = named_or_own(mission.site);
    if (mission.site && !s.sites.site(*mission.site))
      errors.push_back({"/site", "unknown_site", "there is no such site"});
    refuse_if_any(errors);
    changed = names;
    return mission;
  }));
  if (!changed.empty()) {
    s.audit(request, "mission.correct " + to_string(after.id) + " " + changed);
    s.events.add(EventLevel::info, "mission.corrected",
                 after.name + ": " + changed + " corrected by " + request.principal.name, after.id);
  }
  return mission_answer(s, 200, after);
}

}  // namespace

void add_mission_correct_routes(Router& router, MissionApi& s) {
  router.add({Method::patch, "/api/v1/missions/{id}", Access::any_of({Role::op}),
              [&s](const Request& request) { return correct(s, request); }, 1 << 20, false, true});
}

}  // namespace anchord::api
