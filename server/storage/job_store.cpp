#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_job_insert =
    "INSERT INTO job (id, kind, state, fraction, stage, detail, result_href, problem_json, request_json, "
    "created_t_ns, "
    "started_t_ns, finished_t_ns, worker, attempts) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, "
    "?12, ?13, ?14)";
constexpr const char* k_job_update =
    "UPDATE job SET kind = ?2, state = ?3, fraction = ?4, stage = ?5, detail = ?6, result_href = ?7, "
    "problem_json = ?8, request_json = ?9, created_t_ns = ?10, started_t_ns = ?11, finished_t_ns = ?12, "
    "worker = ?13, attempts = ?14 WHERE id = ?1 RETURNING state";
constexpr const char* k_job_columns =
    "SELECT id, kind, state, fraction, stage, detail, result_href, problem_json, request_json, created_t_ns, "
    "started_t_ns, finished_t_ns, worker, attempts FROM job ";
constexpr const char* k_fail_unfinished =
    "UPDATE job SET state = 3, problem_json = ?2, finished_t_ns = ?1 WHERE state IN (0, 1) AND NOT "
    "EXISTS (SELECT 1 FROM work WHERE work.job_id = job.id) RETURNING state";
static_assert(static_cast<int>(JobState::failed) == 3 && static_cast<int>(JobState::running) == 1);

void bind(Query& query, const Job& j) {
  query << j.id << j.kind << static_cast<int>(j.state) << j.fraction << j.stage << j.detail << j.result_href
        << j.problem << j.request << j.created << j.started << j.finished << j.worker << j.attempts;
}

Job read_job(Query& query) {
  Job j;
  j.id = query.id<JobId>();
  j.kind = query.text();
  j.state = query.one_of(k_job_state_words);
  j.fraction = query.real();
  j.stage = query.text();
  j.detail = query.text();
  j.result_href = query.text();
  j.problem = query.document();
  j.request = query.document();
  j.created = query.time();
  j.started = query.maybe_time();
  j.finished = query.maybe_time();
  j.worker = query.text();
  j.attempts = query.as<int>();
  return j;
}

class SqlJobStore final : public JobStore {
 public:
  explicit SqlJobStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Job& job) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_job_insert);
      bind(query, job);
      query.run();
      return std::nullopt;
    });
  }
  Result<void> update(const Job& job) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_job_update);
      bind(query, job);
      if (query.returned()) return std::nullopt;
      return make_error(Errc::not_found, "no job " + to_string(job.id));
    });
  }
  Result<Job> job(const JobId& id) override {
    return read_value<Job>(gate_, [&](Connection& c) -> Result<Job> {
      Query query(c, std::string(k_job_columns) + "WHERE id = ?1");
      query << id;
      if (!query.step()) return make_error(Errc::not_found, "no job " + to_string(id));
      return read_job(query);
    });
  }
  Result<std::vector<Job>> jobs(std::size_t limit, const std::optional<JobId>& after) override {
    return read_value<std::vector<Job>>(gate_, [&](Connection& c) -> Result<std::vector<Job>> {
      Query query(c, std::string(k_job_columns) +
                         (after ? "WHERE id < ?1 ORDER BY id DESC LIMIT ?2" : "ORDER BY id DESC LIMIT ?1"));
      if (after) query << *after;
      query << row_limit(limit);
      std::vector<Job> found;
      while (query.step()) found.push_back(read_job(query));
      return found;
    });
  }
  Result<std::size_t> fail_unfinished(UtcTime now, const Document& problem) override {
    return write_value<std::size_t>(gate_, 1, [&](Connection& c) -> Result<std::size_t> {
      Query query(c, k_fail_unfinished);
      query << now << problem;
      std::size_t n = 0;
      while (query.step()) ++n;
      return n;
    });
  }

 private:
  Gate& gate_;
};

}  // namespace

std::unique_ptr<JobStore> make_job_store(Gate& gate) { return std::make_unique<SqlJobStore>(gate); }

}  // namespace anchord::sql
