#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/base/locked.hpp"
#include "server/storage/postgres_connection.hpp"
#include "server/storage/sql.hpp"

namespace anchord::sql {

/// A bounded number of connections, opened on demand. One that was lost is replaced; while the server is away
/// a new one is tried at most every half second, and everybody else is told at once.
class PostgresPool {
 public:
  using Open = std::function<std::unique_ptr<PostgresConnection>()>;
  /// Since when the server is away; of all pools that reach the same, so that what one finds again is there
  /// for the others too.
  struct Outage {
    std::chrono::steady_clock::time_point not_before{};
    std::optional<SqlError> trouble;  ///< of the last connection that could not be opened
  };
  PostgresPool(Open open, std::size_t size, Locked<Outage>& outage)
      : open_(std::move(open)), size_(size), outage_(outage) {}

  /// Runs `use` with a connection on which `begin` was executed. Throws SqlError, also what `use` throws: the
  /// transaction is undone then. `use` ends the transaction where it goes well.
  void run(const std::string& begin, const std::function<void(PostgresConnection&)>& use);

 private:
  class Place;
  struct Shared {
    std::vector<std::unique_ptr<PostgresConnection>> idle;
    std::size_t in_use{0};
  };
  std::unique_ptr<PostgresConnection> begun(const std::string& begin);
  std::unique_ptr<PostgresConnection> opened();

  const Open open_;
  const std::size_t size_;
  Locked<Outage>& outage_;
  Locked<Shared> shared_;
  std::condition_variable freed_;
};

/// Each call is a transaction: a read sees one snapshot; a write is serialisable, and run again when another
/// one, perhaps of another server, was in its way.
class PostgresGate final : public Gate {
 public:
  struct Limits {
    std::size_t writers, readers, max_rows, max_calls;
    std::chrono::milliseconds statement_timeout;
    std::int64_t fence{0};  ///< of the lease of this server (server_lease.hpp); 0: it has none
  };
  struct Status {
    std::size_t queued_calls{}, queued_rows{};
    std::uint64_t commits{}, rows{}, repeats{};
    double last_commit_s{};
    double oldest_s{};                ///< how long the write that waits longest has waited; 0: none waits
    std::optional<SqlError> trouble;  ///< of the last call that did not reach the database or found no space
  };
  PostgresGate(PostgresPool::Open open, Limits limits);

  /// Of no rows: tells whether the database can be written.
  std::optional<Error> write(std::size_t rows, const Work& work) override;
  std::optional<Error> read(const Work& work) override;
  Status status() const;

 private:
  using Since = std::multiset<std::chrono::steady_clock::time_point>;
  struct Shared {
    Status status;
    Since waiting;  ///< since when each write that is under way is
    /// Commits that ended without an answer or without the standby, the process before's counted as one;
    /// those before a commit that the standby has confirmed.
    std::uint64_t unconfirmed{1}, confirmed{0};
  };
  std::optional<Error> enter(std::size_t rows, Since::const_iterator& entry);
  std::optional<Error> attempt(std::size_t rows, const Work& work);
  std::optional<Error> transaction(const Work& work);
  void note(const SqlError& trouble);
  void count_repeat();

  const Limits limits_;
  const std::string begin_write_, begin_read_;
  Locked<PostgresPool::Outage> outage_;
  PostgresPool writers_, readers_;
  Locked<Shared> shared_;
};

}  // namespace anchord::sql
