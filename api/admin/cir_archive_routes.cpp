#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "api/admin/cir_retention.hpp"
#include "api/admin/job_answer.hpp"
#include "api/admin/routes.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "api/kit/support.hpp"
#include "core/ports/job_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using To = CirRetention::To;

Ordered one_json(const CirRetention& retention, const MissionId& mission) {
  for (const auto& one : value_or_problem(retention.list()))
    if (one.mission == mission) return archived_json(one);
  throw_problem(404, "not-found", "mission " + to_string(mission) + " has no impulse responses in a file");
}

Response move(AdminApi& s, const Request& request) {
  const auto mission = path_id<MissionId>(request);
  const auto body = json_body(request, false);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  const auto to = fields.word("to", k_cirs_to_words, true);
  fields.finish();
  refuse_if_any(errors);
  const auto work = [&s, mission, to = to.value()](JobContext& context) -> Result<JobEnd> {
    context.progress(0, to == To::file ? "to file" : "to database", "");
    const auto moved = s.cir_retention.move(mission, to, [&context](std::chrono::milliseconds pause) {
      if (context.canceled()) return false;
      std::this_thread::sleep_for(pause);
      return !context.canceled();
    });
    if (!moved) return moved.error();
    return JobEnd{"/api/v1/cir-archive", std::to_string(moved.value().n_cirs)};
  };
  Job job = value_or_problem(s.jobs.submit("cir_archive", "{}", work));
  s.audit(request, "cir.archive " + to_string(mission) + " to " + std::string(k_cirs_to_words.word(*to)));
  return job_outcome(s.jobs, request, std::move(job), [&s, mission](const Job&) {
    return json_response(200, one_json(s.cir_retention, mission));
  });
}

}  // namespace

void add_cir_archive_routes(Router& router, AdminApi& s) {
  const auto admin = Access::any_of({Role::admin});
  router.add({Method::get, "/api/v1/cir-archive", admin, [&s](const Request& request) {
                check_query(request, {});
                Ordered items = Ordered::array();
                for (const auto& one : value_or_problem(s.cir_retention.list()))
                  items.push_back(archived_json(one));
                return list_response(request, std::move(items), "");
              }});
  router.add({Method::post, "/api/v1/missions/{id}/cir-archive", admin,
              [&s](const Request& request) { return move(s, request); }});
}

}  // namespace anchord::api
