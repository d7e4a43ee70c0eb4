#include <nlohmann/json.hpp>

#include "api/json/live_writer.hpp"
#include "api/json/reader.hpp"
#include "api/json/wire_resources.hpp"
#include "api/live/hub.hpp"
#include "api/routes/job_answer.hpp"
#include "api/routes/routes.hpp"
#include "api/routes/support.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

/// Revisions that a calibration went into.
Ordered published_in(Services& s, const CalibrationId& id) {
  Ordered out = Ordered::array();
  for (const auto& revision : value_or_problem(s.deps.anchors.revisions(1000, 0))) {
    if (revision.calibration == id) out.push_back(revision.number);
  }
  return out;
}

Ordered whole(Services& s, const Calibration& calibration) {
  Ordered body = calibration_json(calibration, true);
  body["published"] = published_in(s, calibration.id);
  return body;
}

Response list(Services& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  const auto page = page_query(request);
  auto rows =
      value_or_problem(s.deps.anchors.calibrations(page.limit + 1, cursor_id<CalibrationId>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& calibration : rows) {
    Ordered item = calibration_json(calibration, false);
    std::map<std::string, int> verdicts;
    for (const auto& estimate : calibration.anchors) ++verdicts[std::string(verdict_word(estimate.verdict))];
    item["n_anchors"] = calibration.anchors.size();
    item["verdicts"] = verdicts;
    items.push_back(std::move(item));
  }
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
}

Response create(Services& s, const Request& request) {
  std::vector<FieldError> errors;
  auto wanted = read_calibration_request(json_body(request), errors);
  for (std::size_t i = 0; i < wanted.learn_from.size(); ++i) {
    const auto mission = s.missions.mission(wanted.learn_from[i]);
    if (!mission && mission.error().code == Errc::not_found)
      errors.push_back({"/learn_from/" + std::to_string(i), "unknown_mission", "there is no such mission"});
  }
  for (std::size_t i = 0; i < wanted.missions.size(); ++i) {
    const auto mission = s.missions.mission(wanted.missions[i]);
    if (!mission && mission.error().code == Errc::not_found)
      errors.push_back({"/missions/" + std::to_string(i), "unknown_mission", "there is no such mission"});
  }
  refuse_if_any(errors);
  Job job = value_or_problem(s.calibrations.submit(std::move(wanted)));
  s.audit(request, "calibration.start " + to_string(job.id));
  return job_outcome(s, request, std::move(job), [&](const Job& done) {
    const auto calibration = value_or_problem(s.deps.anchors.calibration(CalibrationId{done.id.uuid}));
    Response response = json_response(201, whole(s, calibration));
    response.header("Location", "/api/v1/calibrations/" + to_string(calibration.id));
    return response;
  });
}

/// Which anchors a publication takes. Without a list: those whose verdict is ok. A list may name others only
/// with a reason, which goes to the audit log (reliability.md section 4).
std::vector<NetworkId> chosen(const Calibration& calibration, const nlohmann::json* list,
                              const std::string& reason, std::vector<FieldError>& errors) {
  std::vector<NetworkId> out;
  if (list == nullptr) {
    for (const auto& estimate : calibration.anchors) {
      if (estimate.verdict == Verdict::ok && estimate.best) out.push_back(estimate.anchor);
    }
    if (out.empty())
      throw_problem(422, "state",
                    "no anchor of this calibration has the verdict ok; name anchors and give a reason to "
                    "publish them all the same");
    return out;
  }
  if (!list->is_array() || list->empty() || list->size() > 10'000) {
    errors.push_back({"/anchors", "wrong_type", "must be an array of network ids"});
    return out;
  }
  std::string refused;
  for (std::size_t i = 0; i < list->size(); ++i) {
    const auto& item = (*list)[i];
    const std::string at = "/anchors/" + std::to_string(i);
    const auto id = parse_network_id(item.is_string() ? item.get_ref<const std::string&>() : "");
    if (!id) {
      errors.push_back({at, "bad_id", id.error().message});
      continue;
    }
    const Estimate* found = nullptr;
    for (const auto& estimate : calibration.anchors) {
      if (estimate.anchor == id.value()) found = &estimate;
    }
    if (found == nullptr || !found->best)
      errors.push_back({at, "no_position", "the calibration has no position of " + to_string(id.value())});
    else if (found->verdict != Verdict::ok && reason.empty())
      refused += (refused.empty() ? "" : "; ") + to_string(id.value()) + " is " +
                 std::string(verdict_word(found->verdict)) + ": " + found->reason;
    else
      out.push_back(id.value());
  }
  refuse_if_any(errors);
  if (!refused.empty()) throw_problem(422, "state", refused + " (give a reason to publish all the same)");
  return out;
}

Response publish(Services& s, const Request& request) {
  const auto calibration = value_or_problem(s.deps.anchors.calibration(path_id<CalibrationId>(request)));
  const auto body = json_body(request, true);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  const auto note = fields.text("note", 500).value_or("");
  const auto reason = fields.text("reason", 500).value_or("");
  const auto* list = fields.child("anchors");
  fields.finish();
  refuse_if_any(errors);
  const auto anchors = chosen(calibration, list, reason, errors);
  // Audited before it happens: a publication that nobody can be asked about must not exist.
  s.audit(request,
          "calibration.publish " + to_string(calibration.id) + (reason.empty() ? "" : " reason: " + reason));
  const auto revision = value_or_problem(
      s.deps.anchors.publish(calibration.id, anchors, request.principal.token_id, note, s.deps.clock.now()));
  for (const auto& id : anchors) value_or_problem(s.deps.anchors.find_or_create(id, s.deps.clock.now()));
  s.hub.publish(Topic::revisions,
                Ordered{{"revision", revision.number},
                        {"t_us", revision.published.us()},
                        {"calibration", to_string(calibration.id)}}
                    .dump(),
                revision.published.us());
  s.events.add("info", "revision.published",
               "revision " + std::to_string(revision.number) + " with " + std::to_string(anchors.size()) +
                   " anchors published");
  Ordered answer = revision_json(revision);
  Ordered taken = Ordered::array(), left = Ordered::array();
  for (const auto& id : anchors) taken.push_back(to_string(id));
  for (const auto& estimate : calibration.anchors) {
    if (std::find(anchors.begin(), anchors.end(), estimate.anchor) == anchors.end()) {
      left.push_back({{"network_id", to_string(estimate.anchor)},
                      {"verdict", verdict_word(estimate.verdict)},
                      {"reason", estimate.reason}});
    }
  }
  answer["anchors"] = std::move(taken);
  answer["left_out"] = std::move(left);
  Response response = json_response(201, answer);
  response.header("Location", "/api/v1/anchors?revision=" + std::to_string(revision.number));
  return response;
}

Response revisions(Services& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  const auto page = page_query(request);
  std::uint64_t before = 0;
  if (!page.cursor.empty()) {
    nlohmann::json value;
    if (parse_json(page.cursor, value) || !value.is_number_unsigned())
      throw_problem(422, "validation", "cursor is not one of ours",
                    {{"/cursor", "bad_cursor", "is not one of ours"}});
    before = value.get<std::uint64_t>();
  }
  auto rows = value_or_problem(s.deps.anchors.revisions(page.limit + 1, before));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& revision : rows) items.push_back(revision_json(revision));
  return list_response(request, std::move(items), more ? std::to_string(rows.back().number) : "");
}

}  // namespace

void add_calibration_routes(Router& router, Services& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto engineer = Access::any_of({Role::engineer});
  router.add({Method::get, "/api/v1/calibrations", readers(), on(list)});
  router.add({Method::post, "/api/v1/calibrations", engineer, on(create)});
  router.add({Method::get, "/api/v1/calibrations/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return json_response(
                    200,
                    whole(s, value_or_problem(s.deps.anchors.calibration(path_id<CalibrationId>(request)))));
              }});
  router.add({Method::del, "/api/v1/calibrations/{id}", engineer, [&s](const Request& request) {
                const auto id = path_id<CalibrationId>(request);
                value_or_problem(s.deps.anchors.remove(id));
                s.audit(request, "calibration.delete " + to_string(id));
                Response response;
                response.status = 204;
                return response;
              }});
  router.add({Method::post, "/api/v1/calibrations/{id}/publish", Access::any_of({Role::engineer, Role::op}),
              on(publish)});
  router.add({Method::get, "/api/v1/revisions", readers(), on(revisions)});
}

}  // namespace anchord::api
