#include "server/storage/postgres_gate.hpp"

#include <algorithm>
#include <thread>
#include <utility>

namespace anchord::sql {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr auto k_longest_wait = std::chrono::seconds(10);
constexpr auto k_postgres_gate_reopen_every = std::chrono::milliseconds(500);
constexpr int k_attempts = 12;

/// SET LOCAL ends with the transaction. An acknowledged row is on the disk also where the server was told not
/// to wait for that.
std::string begin_text(const char* mode, std::chrono::milliseconds statement_timeout) {
  const std::string most = std::to_string(statement_timeout.count());
  return std::string("BEGIN ISOLATION LEVEL ") + mode + "; SET LOCAL statement_timeout = " + most +
         "; SET LOCAL lock_timeout = " + most +
         "; SET LOCAL idle_in_transaction_session_timeout = 60000; SELECT set_config('synchronous_commit', "
         "'on', true) WHERE current_setting('synchronous_commit') = 'off'";
}

/// Refused where another server has taken over.
std::string lease_text(std::int64_t fence) {
  return fence == 0 ? "" : "; SELECT assert_server(" + std::to_string(fence) + ")";
}

/// Makes a transaction that writes nothing wait for the standby too. A row whose commit the standby has not
/// confirmed is there for who sends it again, as a duplicate, and must not be acknowledged for that.
constexpr const char* k_wait_for_standby = "; SELECT pg_logical_emit_message(true, 'anchord', '')";

/// Longer with every attempt, and never the same for two that met.
void pause_before(int attempt) {
  const auto odd = static_cast<int>(SteadyClock::now().time_since_epoch().count() % 7);
  std::this_thread::sleep_for(std::chrono::milliseconds(std::min(1 << attempt, 200) + odd));
}

bool of_the_database(Failure failure) {
  return failure != Failure::constraint && failure != Failure::internal;
}

}  // namespace

/// One of the connections there may be; given back or, where it is in an unknown state, closed.
class PostgresPool::Place {
 public:
  explicit Place(PostgresPool& pool) : pool_(pool) {
    auto shared = pool.shared_.lock();
    const auto free = [&](const Shared& s) { return s.in_use < pool.size_; };
    if (!shared.wait_for(pool.freed_, k_longest_wait, free))
      throw SqlError(Failure::unavailable, "database: all connections were busy for 10 s");
    ++shared->in_use;
  }
  ~Place() {
    {
      auto shared = pool_.shared_.lock();
      --shared->in_use;
      if (connection != nullptr) shared->idle.push_back(std::move(connection));
    }
    pool_.freed_.notify_one();
  }
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

  std::unique_ptr<PostgresConnection> connection;

 private:
  PostgresPool& pool_;
};

void PostgresPool::run(const std::string& begin, const std::function<void(PostgresConnection&)>& use) {
  Place place(*this);
  place.connection = begun(begin);
  try {
    use(*place.connection);
  } catch (const std::exception&) {
    try {
      if (place.connection->in_transaction()) place.connection->execute("ROLLBACK");
    } catch (const SqlError&) {
      place.connection.reset();
    }
    if (place.connection != nullptr && !place.connection->usable()) place.connection.reset();
    throw;
  }
}

std::unique_ptr<PostgresConnection> PostgresPool::begun(const std::string& begin) {
  // Idle ones may have been cut off since, all of them by a restart of the server: nothing was done yet, so
  // the next is tried.
  for (;;) {
    std::unique_ptr<PostgresConnection> connection;
    {
      auto shared = shared_.lock();
      if (!shared->idle.empty()) {
        connection = std::move(shared->idle.back());
        shared->idle.pop_back();
      }
    }
    const bool fresh = connection == nullptr;
    if (fresh) connection = opened();
    try {
      connection->execute(begin);
      return connection;
    } catch (const SqlError&) {
      if (fresh || connection->usable()) throw;
    }
  }
}

std::unique_ptr<PostgresConnection> PostgresPool::opened() {
  {
    const auto outage = outage_.lock();
    if (outage->trouble && SteadyClock::now() < outage->not_before) throw SqlError(*outage->trouble);
  }
  try {
    auto connection = open_();
    auto outage = outage_.lock();
    outage->trouble.reset();
    return connection;
  } catch (const SqlError& error) {
    auto outage = outage_.lock();
    outage->trouble = error;
    outage->not_before = SteadyClock::now() + k_postgres_gate_reopen_every;
    throw;
  }
}

PostgresGate::PostgresGate(PostgresPool::Open open, Limits limits)
    : limits_(limits),
      begin_write_(begin_text("SERIALIZABLE", limits.statement_timeout) + lease_text(limits.fence)),
      begin_read_(begin_text("REPEATABLE READ READ ONLY", limits.statement_timeout)),
      writers_(open, limits.writers, outage_),
      readers_(std::move(open), limits.readers, outage_) {}

std::optional<Error> PostgresGate::enter(std::size_t rows, Since::const_iterator& entry) {
  auto shared = shared_.lock();
  auto& status = shared->status;
  const bool too_many_rows = status.queued_rows > 0 && status.queued_rows + rows > limits_.max_rows;
  if (too_many_rows || status.queued_calls >= limits_.max_calls) {
    return make_error(Errc::queue_full,
                      "too many rows are waiting to be written: " + std::to_string(status.queued_rows) +
                          " rows in " + std::to_string(status.queued_calls) + " calls");
  }
  status.queued_rows += rows;
  ++status.queued_calls;
  entry = shared->waiting.insert(SteadyClock::now());
  return std::nullopt;
}

std::optional<Error> PostgresGate::write(std::size_t rows, const Work& work) {
  Since::const_iterator entry;
  if (auto full = enter(rows, entry)) return full;
  std::optional<Error> error;
  try {
    error = attempt(rows, work);
  } catch (const SqlError& failed) {
    if (of_the_database(failed.failure())) note(failed);
    error = to_error(failed);
  } catch (const std::exception& failed) {
    error = make_error(Errc::internal, std::string("storage: ") + failed.what());
  }
  auto shared = shared_.lock();
  shared->status.queued_rows -= rows;
  --shared->status.queued_calls;
  shared->waiting.erase(entry);
  return error;
}

std::optional<Error> PostgresGate::transaction(const Work& work) {
  std::uint64_t unconfirmed = 0;
  bool confirm = false;
  {
    const auto shared = shared_.lock();
    unconfirmed = shared->unconfirmed;
    confirm = shared->confirmed < unconfirmed;
  }
  std::optional<Error> error;
  writers_.run(confirm ? begin_write_ + k_wait_for_standby : begin_write_,
               [&](PostgresConnection& connection) {
                 error = work(connection);
                 if (error) return connection.execute("ROLLBACK");
                 try {
                   connection.commit();
                 } catch (const SqlError& failed) {
                   auto shared = shared_.lock();
                   if (failed.failure() == Failure::unavailable) ++shared->unconfirmed;
                   throw;
                 }
               });
  if (confirm && !error) {
    auto shared = shared_.lock();
    shared->confirmed = std::max(shared->confirmed, unconfirmed);
  }
  return error;
}

std::optional<Error> PostgresGate::attempt(std::size_t rows, const Work& work) {
  for (int n = 1;; ++n) {
    const auto start = SteadyClock::now();
    std::optional<Error> error;
    try {
      error = transaction(work);
    } catch (const SqlError& failed) {
      if (failed.failure() != Failure::contended || n >= k_attempts) throw;
      count_repeat();
      pause_before(n);
      continue;
    }
    auto shared = shared_.lock();
    auto& status = shared->status;
    // Whether there is space again, only rows tell.
    if (rows > 0 || (status.trouble && status.trouble->failure() != Failure::full)) status.trouble.reset();
    if (error || rows == 0) return error;
    ++status.commits;
    status.rows += rows;
    status.last_commit_s = std::chrono::duration<double>(SteadyClock::now() - start).count();
    return std::nullopt;
  }
}

std::optional<Error> PostgresGate::read(const Work& work) {
  std::optional<Error> error;
  try {
    readers_.run(begin_read_, [&](PostgresConnection& connection) {
      error = work(connection);
      connection.execute("ROLLBACK");  // nothing was written
    });
    return error;
  } catch (const SqlError& failed) {
    if (failed.failure() == Failure::unavailable) note(failed);
    return to_error(failed);
  } catch (const std::exception& failed) {
    return make_error(Errc::internal, std::string("storage: ") + failed.what());
  }
}

PostgresGate::Status PostgresGate::status() const {
  const auto shared = shared_.lock();
  Status status = shared->status;
  if (!shared->waiting.empty())
    status.oldest_s = std::chrono::duration<double>(SteadyClock::now() - *shared->waiting.begin()).count();
  return status;
}

void PostgresGate::note(const SqlError& trouble) {
  auto shared = shared_.lock();
  shared->status.trouble = trouble;
}

void PostgresGate::count_repeat() {
  auto shared = shared_.lock();
  ++shared->status.repeats;
}

}  // namespace anchord::sql
