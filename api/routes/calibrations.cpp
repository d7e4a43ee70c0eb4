#include <atomic>
#include <nlohmann/json.hpp>

#include "api/json/live_writer.hpp"
#include "api/json/reader.hpp"
#include "api/json/wire_resources.hpp"
#include "api/live/hub.hpp"
#include "api/routes/routes.hpp"
#include "api/routes/support.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

/// Requests that hold a thread of the pool while they wait for a job. Beyond this the answer is 202 at once,
/// so that patient clients cannot starve all others.
constexpr int k_max_waiting = 2;
std::atomic<int>& waiting() {
  static std::atomic<int> count{0};
  return count;
}

class WaitSlot {
 public:
  WaitSlot() : taken_(++waiting() <= k_max_waiting) {}
  ~WaitSlot() { --waiting(); }
  WaitSlot(const WaitSlot&) = delete;
  WaitSlot& operator=(const WaitSlot&) = delete;
  bool taken() const { return taken_; }

 private:
  bool taken_;
};

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

Response job_answer(int status, const Job& job) {
  Response response = json_response(status, job_json(job));
  response.header("Location", "/api/v1/jobs/" + to_string(job.id));
  if (status == 202) response.header("Retry-After", "1");
  return response;
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
  const int wait_s = prefer_wait_s(request);
  if (wait_s > 0) {
    const WaitSlot slot;
    if (slot.taken()) job = value_or_problem(s.calibrations.wait(job.id, std::chrono::seconds(wait_s)));
  }
  if (job.state == JobState::succeeded) {
    const auto calibration = value_or_problem(s.deps.anchors.calibration(CalibrationId{job.id.uuid}));
    Response response = json_response(201, whole(s, calibration));
    response.header("Location", "/api/v1/calibrations/" + to_string(calibration.id));
    response.header("Preference-Applied", "wait=" + std::to_string(wait_s));
    return response;
  }
  if (job.state == JobState::failed) {
    // The job's own problem is the answer: who waits wants to know why, not that there was a job.
    const auto inner = nlohmann::json::parse(job.problem_json, nullptr, false);
    const int status = inner.is_object() ? inner.value("status", 500) : 500;
    std::string type =
        inner.is_object() ? inner.value("type", std::string("/problems/internal")) : "/problems/internal";
    Response response = problem(status, type.substr(type.rfind('/') + 1),
                                inner.is_object() ? inner.value("detail", std::string()) : "");
    response.header("Location", "/api/v1/jobs/" + to_string(job.id));
    return response;
  }
  return job_answer(202, job);
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

Response jobs(Services& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  const auto page = page_query(request);
  auto rows = value_or_problem(s.deps.jobs.jobs(page.limit + 1, cursor_id<JobId>(page.cursor)));
  const bool more = rows.size() > page.limit;
  if (more) rows.pop_back();
  Ordered items = Ordered::array();
  for (const auto& job : rows) items.push_back(job_json(job));
  return list_response(request, std::move(items), more ? to_string(rows.back().id) : "");
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
  router.add({Method::get, "/api/v1/jobs", readers(), on(jobs)});
  router.add({Method::get, "/api/v1/jobs/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                const Job job = value_or_problem(s.deps.jobs.job(path_id<JobId>(request)));
                return json_response(200, job_json(job));
              }});
  router.add({Method::del, "/api/v1/jobs/{id}", engineer, [&s](const Request& request) {
                const auto id = path_id<JobId>(request);
                const auto canceled = s.calibrations.cancel(id);
                if (!canceled && canceled.error().code == Errc::conflict)
                  throw_problem(422, "state", canceled.error().message);
                const Job job = value_or_problem(canceled);
                s.audit(request, "job.cancel " + to_string(id));
                return json_response(job.state == JobState::canceled ? 200 : 202, job_json(job));
              }});
}

}  // namespace anchord::api
