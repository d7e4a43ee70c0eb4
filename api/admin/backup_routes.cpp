#include "core/ports/backups.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/admin/job_answer.hpp"
#include "api/admin/routes.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "api/kit/support.hpp"
#include "core/ports/job_store.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

Ordered backup_json(const Backup& backup) {
  return {{"name", backup.name},
          {"sequence", backup.sequence},
          {"made_at", to_rfc3339(backup.made)},
          {"bytes", backup.bytes},
          {"sha256", backup.sha256_hex},
          {"good", backup.good ? Ordered(*backup.good) : Ordered(nullptr)},
          {"complete", backup.cir_missing.empty()},
          {"cir_files", backup.cir_files},
          {"cir_bytes", backup.cir_bytes},
          {"cir_missing", backup.cir_missing}};
}

std::string incomplete(const Backup& backup) {
  return "backup " + backup.name + " is not complete: " + std::to_string(backup.cir_missing.size()) +
         " files with impulse responses are missing from it; the first: " + backup.cir_missing.front() +
         ". Copy them into the folder cir-archive of the server and make another backup";
}

}  // namespace

Result<Job> begin_backup(const AdminApi& s) {
  return s.jobs.submit("backup", "{}", [&s](JobContext& job) -> Result<JobEnd> {
    job.progress(0, "copy", "");
    auto made = s.backups.make([&job] { return !job.canceled(); });
    if (!made && made.error().code == Errc::canceled) return std::move(made).error();
    if (!made) {
      s.events.add(EventLevel::warning, "backup.failed", made.error().message);
      return std::move(made).error();
    }
    if (!made.value().cir_missing.empty())
      s.events.add(EventLevel::warning, "backup.incomplete", incomplete(made.value()));
    return JobEnd{"/api/v1/backups", made.value().name};
  });
}

void add_backup_routes(Router& router, AdminApi& s) {
  const auto admin = Access::any_of({Role::admin});
  router.add({Method::get, "/api/v1/backups", admin, [&s](const Request& request) {
                check_query(request, {});
                Ordered items = Ordered::array();
                for (const auto& backup : s.backups.list()) items.push_back(backup_json(backup));
                return list_response(request, std::move(items), "");
              }});
  router.add({Method::post, "/api/v1/backups", admin, [&s](const Request& request) {
                const auto body = json_body(request, true);
                std::vector<FieldError> errors;
                Fields(body, "", errors).finish();
                refuse_if_any(errors);
                if (const auto why = s.backups.refusal()) throw ProblemException{problem_of(*why)};
                Job job = value_or_problem(begin_backup(s));
                s.audit(request, "backup.start " + to_string(job.id));
                return job_outcome(s.jobs, request, std::move(job), [&s](const Job& done) -> Response {
                  for (const auto& backup : s.backups.list()) {
                    if (backup.name == done.detail) return json_response(201, backup_json(backup));
                  }
                  throw_problem(404, "not-found", "the backup no longer exists: newer ones have replaced it");
                });
              }});
}

}  // namespace anchord::api
