#include <nlohmann/json.hpp>

#include "api/admin/alarm_board.hpp"
#include "api/admin/routes.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "api/kit/support.hpp"
#include "api/stream/hub.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

std::optional<SiteId> site_of(const AdminApi& s, const Alarm& alarm) {
  return alarm.condition.mission ? s.hub.site_of(*alarm.condition.mission) : std::nullopt;
}

/// The mission of the alarm of this id that is meant, nothing for one of the server. 404 where none stands
/// that concerns who asks; 409 where several do and the request names no mission: nobody silences what they
/// may not have seen.
std::optional<MissionId> alarm_meant(const AdminApi& s, const std::string& id,
                                     const std::optional<MissionId>& named) {
  std::vector<AlarmCondition> meant;
  for (const auto& alarm : s.alarms.standing()) {
    const auto& c = alarm.condition;
    if (c.id == id && (!named || c.mission == named) && concerns(alarm, site_of(s, alarm), current_sites()))
      meant.push_back(c);
  }
  if (meant.empty()) throw_problem(404, "not-found", "there is no active alarm " + to_utf8(id, 60));
  if (meant.size() > 1) {
    std::string flights;
    for (const auto& c : meant) flights += (flights.empty() ? "" : "; ") + c.text;
    throw_problem(409, "conflict",
                  "several flights have the alarm " + id + ": name one as \"mission\" (" + flights + ')');
  }
  return meant.front().mission;
}

}  // namespace

void add_alarm_routes(Router& router, AdminApi& s) {
  router.add(as_command({Method::get, "/api/v1/alarms", readers(), [&s](const Request& request) {
                           check_query(request, {"fields"});
                           Ordered items = Ordered::array();
                           for (const auto& alarm : s.alarms.standing()) {
                             if (concerns(alarm, site_of(s, alarm), current_sites()))
                               items.push_back(Ordered::parse(alarm_json(alarm)));
                           }
                           return list_response(request, std::move(items), "");
                         }}));
  router.add(as_command(
      {Method::post, "/api/v1/alarms/{id}/ack", Access::any_of({Role::op}),
       [&s](const Request& request) {
         const auto body = json_body(request, true);
         std::vector<FieldError> errors;
         Fields fields(body, "", errors);
         const auto note = fields.text("note", 500).value_or("");
         std::optional<MissionId> named;
         if (const auto text = fields.text("mission", 36)) {
           if (const auto uuid = parse_uuid(*text))
             named = MissionId{uuid.value()};
           else
             fields.error("mission", "bad_id", "is not the id of a mission");
         }
         fields.finish();
         refuse_if_any(errors);
         const std::string& id = request.params.at("id");
         const auto mission = alarm_meant(s, id, named);
         const auto alarm = value_or_problem(s.alarms.acknowledge(id, mission, request.principal.name));
         s.audit.soon(request, "alarm.ack " + alarm.condition.id + (note.empty() ? "" : " note: " + note));
         return json_response(200, Ordered::parse(alarm_json(alarm)));
       },
       k_command_bytes}));
}

}  // namespace anchord::api
