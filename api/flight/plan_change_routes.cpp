// A plan changed in flight: what is flown, what a change would do, and the change itself; and the work on an
// anchor, ended by hand.
#include <nlohmann/json.hpp>

#include "api/flight/plan_change_json.hpp"
#include "api/flight/routes.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"

namespace anchord::api {
namespace {

/// Nothing to be done about it but to ask for something else: the state forbids it.
template <class T>
T allowed(Result<T> result) {
  if (!result && result.error().code == Errc::invalid_argument)
    throw_problem(422, "state", result.error().message);
  return value_or_problem(std::move(result));
}

Response flown_plan(FlightApi& s, const Request& request) {
  check_query(request, {});
  const auto mission = named_mission(s.missions, request).id;
  return json_response(200, flown_plan_json(mission, value_or_problem(s.flights.flown_plan(mission))));
}

Response difference(FlightApi& s, const Request& request) {
  check_query(request, {"undo"});
  const auto mission = named_mission(s.missions, request).id;
  FlightService::PlanOrder order;
  order.undo = query_flag(request, "undo");
  return json_response(200,
                       plan_difference_json(mission, allowed(s.flights.plan_difference(mission, order))));
}

/// Whatever it answers is in the audit log.
Response take(FlightApi& s, const Request& request) {
  const auto mission = named_mission(s.missions, request).id;
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  FlightService::PlanOrder order;
  order.lease = fields.text("lease", 64).value_or("");
  order.undo = fields.boolean("undo").value_or(false);
  if (const auto revision = fields.integer("revision", 1, 1'000'000'000, true))
    order.revision = static_cast<std::uint64_t>(*revision);
  if (const auto next = fields.integer("next_waypoint", 1, 1001))
    order.next_waypoint = static_cast<std::size_t>(*next);
  fields.finish();
  refuse_if_any(errors);
  refuse_elsewhere(s);
  const std::string audited = "mission.plan " + to_string(mission) + (order.undo ? " undo to" : "") +
                              " revision " + std::to_string(*order.revision);
  auto taken = s.flights.take_plan(mission, order, request.principal);
  if (!taken) s.audit.soon(request, audited, "refused: " + taken.error().message);
  if (!taken && taken.error().code == Errc::conflict) throw_problem(409, "no-control", taken.error().message);
  const auto done = allowed(std::move(taken));
  s.audit.soon(request, audited);
  return json_response(200, plan_difference_json(mission, done));
}

/// Whatever it answers is in the audit log.
Response order_anchor(FlightApi& s, const Request& request) {
  const auto mission = named_mission(s.missions, request).id;
  const auto anchor = parse_network_id(request.params.at("anchor"));
  if (!anchor)
    throw_problem(422, "validation", "anchor is not a network id",
                  {{"/anchor", "bad_id", anchor.error().message}});
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto lease = fields.text("lease", 64).value_or("");
  const auto order = fields.word("action", procedure::k_anchor_order_words, true);
  fields.finish();
  refuse_if_any(errors);
  const std::string audited = "anchor." + std::string(procedure::k_anchor_order_words.word(*order)) + ' ' +
                              to_string(anchor.value()) + " of " + to_string(mission);
  const auto done = s.flights.order_anchor(mission, anchor.value(), *order, lease, request.principal);
  s.audit.soon(request, audited, done ? "ok" : "refused: " + done.error().message);
  if (!done && done.error().code == Errc::conflict) throw_problem(409, "no-control", done.error().message);
  if (!done && done.error().code == Errc::invalid_argument) throw_problem(422, "state", done.error().message);
  value_or_problem(done);
  Response response;
  response.status = 204;
  return response;
}

}  // namespace

void add_plan_change_routes(Router& router, FlightApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto op = Access::any_of({Role::op});
  const std::string base = "/api/v1/missions/{id}/plan";
  router.add({Method::get, base, readers(), on(flown_plan)});
  router.add(as_heavy({Method::get, base + "/change", readers(), on(difference)}));
  router.add(keeps_always(
      {Method::post, "/api/v1/missions/{id}/anchors/{anchor}/work", op, on(order_anchor), k_command_bytes}));
  router.add(keeps_always(as_flight({Method::post, base, op, on(take), k_command_bytes})));
}

}  // namespace anchord::api
