#include <atomic>
#include <nlohmann/json.hpp>

#include "api/admin/job_answer.hpp"
#include "api/admin/job_json.hpp"
#include "api/admin/routes.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/router.hpp"
#include "api/kit/seen_page.hpp"
#include "api/kit/support.hpp"
#include "core/ports/job_store.hpp"

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

Response list(AdminApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<JobId>(
      request,
      [&](std::size_t limit, const std::optional<JobId>& after) {
        return seen_page<Job>(
            limit, after, [&](auto n, const auto& from) { return s.job_store.jobs(n, from); },
            [&](const Job& job) -> Result<bool> { return s.jobs.seen(job.id); },
            [](const Job& job) { return job.id; });
      },
      [&](const auto& job) { return job_json(job); });
}

}  // namespace

Response job_answer(int status, const Job& job) {
  Response response = json_response(status, job_json(job));
  response.header("Location", "/api/v1/jobs/" + to_string(job.id));
  if (status == 202) response.header("Retry-After", "1");
  return response;
}

Response job_outcome(JobService& jobs, const Request& request, Job job,
                     const std::function<Response(const Job&)>& finished) {
  const int wait_s = prefer_wait_s(request);
  if (wait_s > 0) {
    const WaitSlot slot;
    if (slot.taken()) job = value_or_problem(jobs.wait(job.id, std::chrono::seconds(wait_s)));
  }
  if (job.state == JobState::succeeded) {
    Response response = finished(job);
    if (wait_s > 0) response.header("Preference-Applied", "wait=" + std::to_string(wait_s));
    return response;
  }
  if (job.state == JobState::failed) {
    const auto inner = nlohmann::json::parse(job.problem.text, nullptr, false);
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

void add_job_routes(Router& router, AdminApi& s) {
  const auto engineer = Access::any_of({Role::engineer});
  router.add(
      {Method::get, "/api/v1/jobs", readers(), [&s](const Request& request) { return list(s, request); }});
  router.add({Method::get, "/api/v1/jobs/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                const Job job = value_or_problem(s.job_store.job(path_id<JobId>(request)));
                return json_response(200, job_json(job));
              }});
  router.add({Method::del, "/api/v1/jobs/{id}", engineer, [&s](const Request& request) {
                const auto id = path_id<JobId>(request);
                const auto canceled = s.jobs.cancel(id);
                if (!canceled && canceled.error().code == Errc::conflict)
                  throw_problem(422, "state", canceled.error().message);
                const Job job = value_or_problem(canceled);
                s.audit(request, "job.cancel " + to_string(id));
                return json_response(job.state == JobState::canceled ? 200 : 202, job_json(job));
              }});
}

}  // namespace anchord::api
