#include "server/storage/work_store.hpp"

#include "core/base/errc_words.hpp"
#include "server/storage/postgres_gate.hpp"
#include "server/storage/postgres_migrate.hpp"
#include "server/storage/postgres_text.hpp"
#include "server/storage/sqlite_database.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_work_remove = "DELETE FROM work WHERE job_id = ?1 AND (?2 IS NULL OR fence = ?2)";
constexpr const char* k_work_insert =
    "INSERT INTO work (job_id, kind, version, message, state, fence, attempts, max_attempts, worker, "
    "open_t_ns, lease_t_ns, cancel_wanted, fraction, stage, detail, fault, result, error_code, error_text) "
    "VALUES (?1, ?2, ?3, ?4, 0, now_ns(), 0, ?5, '', now_ns(), 0, 0, 0, 'queued', '', '', NULL, '', '')";
constexpr const char* k_work_all =
    "SELECT job_id, kind, version, state, fence, worker, attempts, max_attempts, fraction, stage, detail, "
    "fault, "
    "CASE WHEN state = 0 THEN now_ns() - open_t_ns WHEN state = 1 AND lease_t_ns < now_ns() THEN now_ns() - "
    "lease_t_ns ELSE 0 END FROM work ORDER BY job_id";
constexpr const char* k_outcome =
    "SELECT state, error_code, error_text, octet_length(result), CASE WHEN octet_length(result) > ?2 THEN '' "
    "ELSE result END FROM work WHERE job_id = ?1";
constexpr const char* k_work_state = "SELECT state FROM work WHERE job_id = ?1";
constexpr const char* k_cancel_open =
    "UPDATE work SET state = 2, error_code = 'canceled', error_text = 'canceled' WHERE job_id = ?1";
constexpr const char* k_cancel_claimed = "UPDATE work SET cancel_wanted = 1 WHERE job_id = ?1";
constexpr const char* k_claimable =
    "SELECT EXISTS (SELECT 1 FROM work WHERE version = ?1 AND cancel_wanted = 0 AND attempts < max_attempts "
    "AND ((state = 0 AND open_t_ns <= now_ns() - ?2) OR (state = 1 AND lease_t_ns < now_ns() - ?2)) AND "
    "(?3 = '' OR kind = ?3))";
constexpr const char* k_claim =
    "UPDATE work SET fault = CASE WHEN state = 1 THEN 'worker ' || worker || ' no longer answered' ELSE "
    "fault END, state = 1, fence = fence + 1, attempts = attempts + 1, worker = ?1, lease_t_ns = now_ns() + "
    "?2, "
    "fraction = 0, stage = 'load', detail = '' WHERE job_id = (SELECT job_id FROM work WHERE version = ?3 "
    "AND cancel_wanted = 0 AND attempts < max_attempts AND ((state = 0 AND open_t_ns <= now_ns() - ?4) OR "
    "(state "
    "= 1 AND lease_t_ns < now_ns() - ?4)) AND (?5 = '' OR kind = ?5) ORDER BY open_t_ns, job_id LIMIT 1 FOR "
    "UPDATE SKIP LOCKED) "
    "RETURNING job_id, kind, message, fence, attempts";
// The fence moves on too: who comes back later than this finds that it has nothing any more.
constexpr const char* k_end_hopeless =
    "UPDATE work SET state = 2, fence = fence + 1, error_code = CASE WHEN cancel_wanted = 1 THEN 'canceled' "
    "ELSE 'link_lost' END, error_text = CASE WHEN cancel_wanted = 1 THEN 'canceled' ELSE 'worker ' || worker "
    "|| ' no longer answers; ' || attempts || ' attempts were begun and none came to an end: look at the "
    "logs of the workers and at their memory, then start it again' END WHERE state = 1 AND lease_t_ns < "
    "now_ns() AND (cancel_wanted = 1 OR attempts >= max_attempts)";
constexpr const char* k_beat =
    "UPDATE work SET lease_t_ns = now_ns() + ?3, fraction = ?4, stage = ?5, detail = ?6 WHERE job_id = ?1 "
    "AND fence = ?2 AND state = 1 RETURNING cancel_wanted";
constexpr const char* k_work_finish =
    "UPDATE work SET state = 2, result = ?3 WHERE job_id = ?1 AND fence = ?2 AND state = 1 RETURNING state";
constexpr const char* k_fail =
    "UPDATE work SET state = 2, error_code = ?3, error_text = ?4 WHERE job_id = ?1 AND fence = ?2 AND state "
    "= 1 RETURNING state";
constexpr const char* k_attempts_left =
    "SELECT max_attempts - attempts FROM work WHERE job_id = ?1 AND fence = ?2 AND state = 1";
constexpr const char* k_open_again =
    "UPDATE work SET state = 0, open_t_ns = now_ns(), attempts = attempts - ?3, fault = ?4, fraction = 0, "
    "stage = 'queued', detail = '' WHERE job_id = ?1 AND fence = ?2 AND state = 1 RETURNING state";
constexpr const char* k_seen =
    "INSERT INTO worker (name, version, started_t_ns, seen_t_ns) VALUES (?1, ?2, now_ns(), now_ns()) ON "
    "CONFLICT (name) DO UPDATE SET version = excluded.version, seen_t_ns = excluded.seen_t_ns";
constexpr const char* k_work_forget =
    "DELETE FROM worker WHERE seen_t_ns < now_ns() - 86400 * CAST(1000000000 AS BIGINT)";
constexpr const char* k_gone = "DELETE FROM worker WHERE name = ?1";
constexpr const char* k_workers =
    "SELECT w.name, w.version, now_ns() - w.seen_t_ns, (SELECT j.job_id FROM work j WHERE j.state = 1 AND "
    "j.worker = w.name ORDER BY j.job_id LIMIT 1) FROM worker w ORDER BY w.name";

std::int64_t ns(std::chrono::milliseconds time) { return std::chrono::nanoseconds(time).count(); }

Error taken_over(const JobId& job) {
  return make_error(Errc::conflict, "job " + to_string(job) +
                                        " no longer belongs to this worker: it gave no sign of life for "
                                        "longer than its lease, or the job was removed");
}

class SqlWorkStore final : public WorkStore {
 public:
  explicit SqlWorkStore(Gate& gate) : gate_(gate) {}
  explicit SqlWorkStore(std::unique_ptr<Gate> own) : own_(std::move(own)), gate_(*own_) {}

  Result<void> offer(const NewWork& work) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      {
        Query older(c, k_work_remove);
        older << work.job << std::nullopt;
        older.run();
      }
      Query query(c, k_work_insert);
      query << work.job << work.kind << work.version << work.message << work.max_attempts;
      query.run();
      return std::nullopt;
    });
  }
  Result<void> end_hopeless() override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query(c, k_end_hopeless).run();
      return std::nullopt;
    });
  }
  Result<std::vector<WorkStatus>> all() override {
    return read_value<std::vector<WorkStatus>>(gate_, [&](Connection& c) -> Result<std::vector<WorkStatus>> {
      Query query(c, k_work_all);
      std::vector<WorkStatus> found;
      while (query.step()) {
        WorkStatus s;
        s.job = query.id<JobId>();
        s.kind = query.text();
        s.version = query.text();
        s.state = query.one_of(k_work_state_words);
        s.fence = query.integer();
        s.worker = query.text();
        s.attempts = query.as<int>();
        s.max_attempts = query.as<int>();
        s.fraction = query.real();
        s.stage = query.text();
        s.detail = query.text();
        s.fault = query.text();
        s.waiting_s = static_cast<double>(query.integer()) / 1e9;
        found.push_back(std::move(s));
      }
      return found;
    });
  }
  Result<WorkOutcome> outcome(const JobId& job) override {
    return read_value<WorkOutcome>(gate_, [&](Connection& c) -> Result<WorkOutcome> {
      Query query(c, k_outcome);
      query << job << k_most_result_bytes;
      if (!query.step()) return absent("work of job", job);
      if (query.one_of(k_work_state_words) != WorkState::done)
        return make_error(Errc::conflict, "job " + to_string(job) + " is not done");
      const auto code = query.text();
      auto text = query.text();
      const auto bytes = query.integer();
      if (bytes > k_most_result_bytes)
        return WorkOutcome{
            {},
            make_error(Errc::link_lost, "the result is of " + std::to_string(bytes) + " bytes; " +
                                            std::to_string(k_most_result_bytes) + " are allowed")};
      if (code.empty()) return WorkOutcome{query.text(), std::nullopt};
      const auto known = k_errc_words.parse("error_code", code);
      return WorkOutcome{{}, make_error(known ? known.value() : Errc::internal, std::move(text))};
    });
  }
  Result<void> remove(const JobId& job, std::optional<std::int64_t> fence) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_work_remove);
      query << job << fence;
      query.run();
      return std::nullopt;
    });
  }
  Result<bool> cancel(const JobId& job) override {
    return write_value<bool>(gate_, 1, [&](Connection& c) -> Result<bool> {
      std::optional<WorkState> state;
      {
        Query query(c, k_work_state);
        query << job;
        if (!query.step()) return false;
        state = query.one_of(k_work_state_words);
      }
      if (state == WorkState::open) run(c, k_cancel_open, job);
      if (state == WorkState::claimed) run(c, k_cancel_claimed, job);
      return true;
    });
  }

  Result<std::optional<WorkClaim>> claim(const Wish& wish) override {
    // Who finds nothing, which is most often so, has written nothing.
    BOOST_OUTCOME_TRY(const auto there, read_value<bool>(gate_, [&](Connection& c) -> Result<bool> {
                        Query query(c, k_claimable);
                        query << wish.version << ns(wish.left_alone) << wish.kind;
                        return query.step() && query.integer() != 0;
                      }));
    if (!there) return std::optional<WorkClaim>{};
    return write_value<std::optional<WorkClaim>>(
        gate_, 1, [&](Connection& c) -> Result<std::optional<WorkClaim>> {
          Query query(c, k_claim);
          query << wish.worker << ns(wish.lease) << wish.version << ns(wish.left_alone) << wish.kind;
          if (!query.step()) return std::optional<WorkClaim>{};
          WorkClaim claim;
          claim.job = query.id<JobId>();
          claim.kind = query.text();
          claim.message = query.text();
          claim.fence = query.integer();
          claim.attempt = query.as<int>();
          query.run();
          return std::optional<WorkClaim>(std::move(claim));
        });
  }
  Result<bool> beat(const WorkClaim& claim, const Beat& beat) override {
    return write_value<bool>(gate_, 1, [&](Connection& c) -> Result<bool> {
      Query query(c, k_beat);
      query << claim.job << claim.fence << ns(beat.lease) << beat.fraction << beat.stage << beat.detail;
      const auto canceled = query.returned();
      if (!canceled) return taken_over(claim.job);
      return *canceled != 0;
    });
  }
  Result<void> finish(const WorkClaim& claim, std::string_view result) override {
    return guarded_write(claim, k_work_finish, [&](Query& query) { query << result; });
  }
  Result<void> fail(const WorkClaim& claim, const Error& error) override {
    return guarded_write(claim, k_fail,
                         [&](Query& query) { query << k_errc_words.word(error.code) << error.message; });
  }
  Result<void> retry(const WorkClaim& claim, const Error& error) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      std::int64_t left = 0;
      {
        Query query(c, k_attempts_left);
        query << claim.job << claim.fence;
        if (!query.step()) return taken_over(claim.job);
        left = query.integer();
      }
      Query query(c, left > 0 ? k_open_again : k_fail);
      query << claim.job << claim.fence;
      if (left > 0)
        query << 0 << error.message;
      else
        query << k_errc_words.word(error.code)
              << error.message + " (attempt " + std::to_string(claim.attempt) + ", the last one)";
      return query.returned() ? std::nullopt : std::optional<Error>(taken_over(claim.job));
    });
  }
  Result<void> give_back(const WorkClaim& claim) override {
    return guarded_write(claim, k_open_again, [&](Query& query) { query << 1 << ""; });
  }

  Result<void> seen(std::string_view worker, std::string_view version) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_seen);
      query << worker << version;
      query.run();
      return std::nullopt;
    });
  }
  Result<void> gone(std::string_view worker) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_gone);
      query << worker;
      query.run();
      Query(c, k_work_forget).run();
      return std::nullopt;
    });
  }
  Result<std::vector<WorkerStatus>> workers() override {
    return read_value<std::vector<WorkerStatus>>(
        gate_, [&](Connection& c) -> Result<std::vector<WorkerStatus>> {
          Query query(c, k_workers);
          std::vector<WorkerStatus> found;
          while (query.step()) {
            WorkerStatus w;
            w.name = query.text();
            w.version = query.text();
            w.seen_s_ago = static_cast<double>(query.integer()) / 1e9;
            w.job = query.maybe([&] { return query.id<JobId>(); });
            found.push_back(std::move(w));
          }
          return found;
        });
  }

 private:
  static void run(Connection& c, const char* sql, const JobId& job) {
    Query query(c, sql);
    query << job;
    query.run();
  }
  /// The statement both checks the fence and writes: nobody comes between.
  template <class Bind>
  Result<void> guarded_write(const WorkClaim& claim, const char* sql, Bind bind) {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, sql);
      query << claim.job << claim.fence;
      bind(query);
      return query.returned() ? std::nullopt : std::optional<Error>(taken_over(claim.job));
    });
  }

  const std::unique_ptr<Gate> own_;  ///< null: somebody else's
  Gate& gate_;
};

}  // namespace

std::unique_ptr<WorkStore> make_work_store(Gate& gate) { return std::make_unique<SqlWorkStore>(gate); }

}  // namespace anchord::sql

namespace anchord {

Result<std::unique_ptr<WorkStore>> open_work(const std::string& address) {
  const auto shown = sql::shown_address(address);
  if (const auto fault = sql::address_fault(address); !fault.empty())
    return make_error(Errc::invalid_argument, "database " + shown + ": " + fault);
  try {
    sql::PostgresConnection connection(address);
    if (const int version = sql::postgres_version(connection); version != newest_schema_version())
      return make_error(Errc::unsupported,
                        "database " + shown + " has version " + std::to_string(version) +
                            ", this anchord needs version " + std::to_string(newest_schema_version()) +
                            ": install the same version on server and workers, the server first");
  } catch (const sql::SqlError& error) {
    return sql::to_error(error);
  }
  // One claim at a time, with its beats: few connections, each opened when it is wanted first.
  return std::make_unique<sql::SqlWorkStore>(std::make_unique<sql::PostgresGate>(
      [address] { return std::make_unique<sql::PostgresConnection>(address); },
      sql::PostgresGate::Limits{2, 2, 1'000, 100, std::chrono::seconds(60)}));
}

}  // namespace anchord
