#include <nlohmann/json.hpp>

#include "api/formats/kml_plan.hpp"
#include "api/formats/plan_export.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/kit/support.hpp"
#include "api/planning/plan_json.hpp"
#include "api/planning/routes.hpp"
#include "api/planning/site_structures.hpp"
#include "core/base/line_text.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

std::string etag(const Plan& plan) { return "\"p-" + std::to_string(plan.version) + '"'; }

/// `notes`: what an import left out; absent where the plan is not of a file.
Response answer(int status, const Plan& plan, const std::optional<std::vector<std::string>>& notes = {}) {
  auto body = plan_json(plan);
  if (notes) body["notes"] = *notes;
  Response response = json_response(status, body);
  response.header("ETag", etag(plan));
  return response;
}

Plan load(PlanningApi& s, const Request& request) {
  return plan_of(value_or_problem(s.plans.plan(path_id<PlanId>(request))));
}

Response list(PlanningApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<PlanId>(
      request,
      [&](std::size_t limit, const std::optional<PlanId>& after) { return s.plans.plans(limit, after); },
      [&](const auto& row) { return plan_json(plan_of(row)); });
}

/// Stores a plan that was read; refuses what is wrong with it.
Response store_new(PlanningApi& s, const Request& request, Plan plan, std::vector<FieldError> errors,
                   const std::optional<std::vector<std::string>>& notes = {}) {
  plan.site = named_or_own(plan.site);
  if (plan.site && !s.sites.site(*plan.site))
    errors.push_back({"/site", "unknown_site", "there is no such site"});
  refuse_if_any(errors);
  plan.created = plan.changed = s.clock.now();
  plan.id.uuid = make_uuid_v7(plan.created);
  plan.version = 1;
  value_or_problem(s.plans.insert(stored(plan)));
  s.audit(request, "plan.create " + to_string(plan.id));
  Response response = answer(201, plan, notes);
  response.header("Location", "/api/v1/plans/" + to_string(plan.id));
  return response;
}

Response create(PlanningApi& s, const Request& request) {
  std::vector<FieldError> errors;
  Plan plan = read_plan(json_body(request), errors);
  return store_new(s, request, std::move(plan), std::move(errors));
}

Response replace(PlanningApi& s, const Request& request, const Plan& old, Plan plan,
                 std::vector<FieldError> errors) {
  plan.site = named_or_own(plan.site);
  if (plan.site && !s.sites.site(*plan.site))
    errors.push_back({"/site", "unknown_site", "there is no such site"});
  refuse_if_any(errors);
  plan.id = old.id;
  plan.created = old.created;
  plan.changed = s.clock.now();
  value_or_problem(s.plans.update(stored(plan), old.version));
  plan.version = old.version + 1;
  s.saved(plan);
  s.audit(request, "plan.change " + to_string(plan.id));
  return answer(200, plan);
}

Response put(PlanningApi& s, const Request& request) {
  const Plan old = load(s, request);
  require_match(request, etag(old));
  std::vector<FieldError> errors;
  Plan plan = read_plan(json_body(request), errors);
  return replace(s, request, old, std::move(plan), std::move(errors));
}

Response patch(PlanningApi& s, const Request& request) {
  const Plan old = load(s, request);
  require_match(request, etag(old));
  auto whole = nlohmann::json::parse(to_wire(plan_json(old)));
  whole.merge_patch(json_body(request));
  std::vector<FieldError> errors;
  Plan plan = read_plan(whole, errors);
  return replace(s, request, old, std::move(plan), std::move(errors));
}

Response remove(PlanningApi& s, const Request& request) {
  const Plan plan = load(s, request);
  require_match(request, etag(plan));
  if (const auto mission = s.flown_with(plan.id))
    throw_problem(409, "conflict",
                  plan.name + " is being flown by mission " + to_string(*mission) + ": land first");
  value_or_problem(s.plans.remove(plan.id, plan.version));
  s.audit(request, "plan.delete " + to_string(plan.id));
  Response response;
  response.status = 204;
  return response;
}

Response validate(PlanningApi& s, const Request& request) {
  Plan plan = load(s, request);
  value_or_problem(s.structures.join(plan));
  return json_response(200, plan_check_json(value_or_problem(planning::check_plan(plan))));
}

/// The same of a plan that need not be stored: what is drawn is judged while it is drawn.
Response validate_body(PlanningApi& s, const Request& request) {
  std::vector<FieldError> errors;
  auto body = json_body(request);
  if (body.is_object() && !body.contains("name")) body["name"] = "Drawn";
  Plan plan = read_plan(body, errors);
  refuse_if_any(errors);
  value_or_problem(s.structures.join(plan));
  return json_response(200, plan_check_json(value_or_problem(planning::check_plan(plan))));
}

/// The body is a plan that need not be stored; the answer is the same one with waypoints, and its check.
Response generate(PlanningApi& s, const Request& request) {
  std::vector<FieldError> errors;
  auto body = json_body(request);
  if (body.is_object() && !body.contains("name")) body["name"] = "Generated";
  Plan plan = read_plan(body, errors);
  if (errors.empty() && plan.outline.empty())
    errors.push_back({"/outline", "required", "the waypoints are computed from it"});
  refuse_if_any(errors);
  value_or_problem(s.structures.join(plan));
  const auto made = value_or_problem(planning::generate_waypoints(plan));
  auto out = plan_json(made.plan);
  for (const char* key : {"id", "revision", "created_at", "changed_at"}) out.erase(key);
  return json_response(200, Ordered{{"plan", std::move(out)}, {"check", plan_check_json(made.check)}});
}

Response import(PlanningApi& s, const Request& request) {
  check_query(request, {"name", "dry_run"});
  std::vector<FieldError> errors;
  std::vector<std::string> notes;
  const std::string_view type = request.header("content-type");
  const bool kml = type.starts_with("application/vnd.google-earth.kml+xml") ||
                   type.starts_with("application/xml") || type.starts_with("text/xml");
  if (!kml) (void)json_body(request);  // refuses another type, broken text, compression
  Plan plan = read_plan_file(text_body(request), notes, errors);
  plan.name = to_utf8(request.query_value("name").value_or("Imported plan"));
  if (const auto fault = line_fault(plan.name, record_limits::k_name); fault != LineFault::none)
    errors.push_back({"/name", fault == LineFault::too_long ? "out_of_range" : "control_character",
                      in_words(fault, record_limits::k_name)});
  refuse_if_any(errors);
  if (query_flag(request, "dry_run")) {
    auto out = plan_json(plan);
    for (const char* key : {"id", "revision", "created_at", "changed_at"}) out.erase(key);
    return json_response(200, Ordered{{"plan", std::move(out)}, {"notes", notes}});
  }
  return store_new(s, request, std::move(plan), {}, std::move(notes));
}

Response export_plan(PlanningApi& s, const Request& request) {
  check_query(request, {"format", "autopilot"});
  const Plan plan = load(s, request);
  const auto autopilot = query_word(request, "autopilot", k_autopilot_words).value_or(Autopilot::ardupilot);
  const auto format = request.query_value("format").value_or("plan");
  Response response;
  if (format == "plan") {
    response.body = value_or_problem(plan_qgc(plan, autopilot));
    response.header("Content-Type", "application/json");
  } else if (format == "geojson") {
    response.body = value_or_problem(plan_geojson(plan));
    response.header("Content-Type", "application/geo+json");
  } else {
    throw_problem(422, "validation", "unknown format",
                  {{"/format", "unknown_value", "must be plan or geojson"}});
  }
  response.header("Content-Disposition", "attachment; filename=\"" + to_string(plan.id) +
                                             (format == "plan" ? ".plan\"" : ".geojson\""));
  return response;
}

}  // namespace

void add_plan_routes(Router& router, PlanningApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  constexpr std::uint64_t k_body = 2 << 20;
  const auto op = Access::any_of({Role::op});
  router.add({Method::get, "/api/v1/plans", readers(), on(list)});
  router.add({Method::post, "/api/v1/plans", op, on(create), k_body});
  router.add(keeps_nothing(as_heavy({Method::post, "/api/v1/plans/generate", op, on(generate), k_body})));
  router.add(
      keeps_nothing(as_heavy({Method::post, "/api/v1/plans/validate", op, on(validate_body), k_body})));
  router.add(as_heavy({Method::post, "/api/v1/plans/import", op, on(import), k_body}));
  router.add({Method::get, "/api/v1/plans/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return answer(200, load(s, request));
              }});
  router.add({Method::put, "/api/v1/plans/{id}", op, on(put), k_body, false, true});
  router.add({Method::patch, "/api/v1/plans/{id}", op, on(patch), k_body, false, true});
  router.add({Method::del, "/api/v1/plans/{id}", op, on(remove), 1 << 20, false, true});
  router.add(keeps_nothing(as_heavy({Method::post, "/api/v1/plans/{id}/validate", readers(), on(validate)})));
  router.add(as_heavy({Method::get, "/api/v1/plans/{id}/export", readers(), on(export_plan)}));
}

}  // namespace anchord::api
