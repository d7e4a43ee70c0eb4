#include <nlohmann/json.hpp>

#include "api/admin/alarm_board.hpp"
#include "api/admin/routes.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "api/kit/support.hpp"
#include "api/stream/hub.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

std::optional<SiteId> site_of(const AdminApi& s, const Alarm& alarm) {
  return alarm.condition.mission ? s.hub.site_of(*alarm.condition.mission) : std::nullopt;
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
         fields.finish();
         refuse_if_any(errors);
         const std::string& id = request.params.at("id");
         for (const auto& alarm : s.alarms.standing()) {
           if (alarm.condition.id == id && !concerns(alarm, site_of(s, alarm), current_sites()))
             return problem(404, "not-found", "no alarm " + id + " stands");
         }
         const auto alarm = value_or_problem(s.alarms.acknowledge(id, request.principal.name));
         s.audit.soon(request, "alarm.ack " + alarm.condition.id + (note.empty() ? "" : " note: " + note));
         return json_response(200, Ordered::parse(alarm_json(alarm)));
       },
       k_command_bytes}));
}

}  // namespace anchord::api
