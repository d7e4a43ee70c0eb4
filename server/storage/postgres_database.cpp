#include "server/storage/postgres_database.hpp"

#include <condition_variable>
#include <utility>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "migrations/migration.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/database_copy.hpp"
#include "server/storage/postgres_gate.hpp"
#include "server/storage/postgres_migrate.hpp"
#include "server/storage/postgres_text.hpp"
#include "server/storage/stalled.hpp"
#include "server/storage/stores.hpp"
#include "server/storage/work_store.hpp"

namespace anchord {
namespace {

using sql::PostgresConnection;
using sql::PostgresGate;
using sql::SqlError;

constexpr auto k_look_every = std::chrono::seconds(2);
constexpr const char* k_bytes = "SELECT pg_database_size(current_database())";
constexpr const char* k_has_rows = "SELECT EXISTS (SELECT 1 FROM mission) OR EXISTS (SELECT 1 FROM token)";
constexpr const char* k_who =
    "SELECT CASE WHEN lease_t_ns > now_ns() THEN server ELSE '' END, "
    "CASE WHEN standby_t_ns > now_ns() - 30000000000 THEN standby ELSE '' END FROM server_lease";
constexpr const char* k_facts =
    "SELECT current_setting('server_version'), pg_database_size(current_database())";

class PostgresDatabase final : public Database {
 public:
  PostgresDatabase(const PostgresOptions& options, std::unique_ptr<sql::DataFolder> folder,
                   std::unique_ptr<ServerLease> lease)
      : folder_(std::move(folder)),
        lease_(std::move(lease)),
        gate_(
            [address = options.address] {
              return std::make_unique<PostgresConnection>(address, k_server_sessions);
            },
            {options.writers, options.readers, options.max_queued_rows, options.max_queued_calls,
             options.statement_timeout, lease_ ? lease_->fence() : 0}),
        // The disk is the database server's: whether a mission still fits, it says when it does not.
        kept_(
            gate_, [] { return std::optional<Error>{}; }, sql::CirFolder(folder_->cir_archive())),
        work_(sql::make_work_store(gate_)),
        watch_("anchord-dbwatch", [this] { watch(); }) {}

  ~PostgresDatabase() override {
    {
      auto seen = seen_.lock();
      seen->stopping = true;
    }
    stop_.notify_one();
    watch_.join();
  }

  const Stores& stores() override { return kept_.ports; }
  CirArchive& cir_archive() override { return *kept_.cir_archive; }

  /// Asks nobody: what the last calls met, and those of watch().
  StorageHealth health() override {
    const auto status = gate_.status();
    StorageHealth health;
    health.queued_calls = status.queued_calls;
    health.queued_rows = status.queued_rows;
    health.commits = status.commits;
    health.rows_written = status.rows;
    health.last_commit_s = status.last_commit_s;
    health.schema_version = newest_schema_version();
    health.db_bytes = seen_.copy().bytes;
    health.disk_free_bytes = folder_->free_bytes();
    if (lease_) health.stood_by = lease_->stood_by();
    if (status.trouble) {
      health.level =
          status.trouble->failure() == sql::Failure::full ? StorageLevel::full : StorageLevel::unavailable;
      health.reason = status.trouble->what();
    } else {
      sql::note_stall(status.oldest_s, "its server, the disk of that server or the network does not respond",
                      health);
    }
    return health;
  }

  Result<BackupReport> backup(const std::filesystem::path&, const GoOn&) override {
    return make_error(Errc::unsupported, k_postgres_backups);
  }
  WorkStore* work() override { return work_.get(); }

 private:
  struct Seen {
    std::uint64_t bytes{0};
    bool stopping{false};
  };

  /// A database that fell away is tried also when nobody writes, so that readiness comes back by itself; and
  /// one that answers no more is noticed.
  void watch() {
    for (;;) {
      (void)guarded("database watch", [this] { look(); });
      auto seen = seen_.lock();
      if (seen.wait_for(stop_, k_look_every, [](const Seen& s) { return s.stopping; })) return;
    }
  }
  void look() {
    std::uint64_t bytes = 0;
    const auto error = gate_.write(0, [&](sql::Connection& c) -> std::optional<Error> {
      sql::Query query(c, k_bytes);
      if (query.step()) bytes = query.as<std::uint64_t>();
      return std::nullopt;
    });
    if (error) return;
    auto seen = seen_.lock();
    seen->bytes = bytes;
  }

  const std::unique_ptr<sql::DataFolder> folder_;
  const std::unique_ptr<ServerLease> lease_;
  PostgresGate gate_;
  sql::SqlStores kept_;
  const std::unique_ptr<WorkStore> work_;
  Locked<Seen> seen_;
  std::condition_variable stop_;
  Thread watch_;
};

bool has_rows(sql::Connection& connection) {
  sql::Query query(connection, k_has_rows);
  return query.step() && query.integer() != 0;
}

/// Not yet in an empty database, nor in one of an older version.
bool has_lease(sql::Connection& connection) {
  sql::Query query(connection, "SELECT to_regclass('server_lease') IS NOT NULL");
  return query.step() && query.integer() != 0;
}

Result<void> check_address(const std::string& address) {
  if (const auto fault = sql::address_fault(address); !fault.empty())
    return make_error(Errc::invalid_argument, "database " + sql::shown_address(address) + ": " + fault);
  return boost::outcome_v2::success();
}

}  // namespace

Result<std::unique_ptr<Database>> open_postgres(const PostgresOptions& options) {
  BOOST_OUTCOME_TRYV(check_address(options.address));
  BOOST_OUTCOME_TRY(auto folder, sql::DataFolder::open(options.data_dir, 0));
  try {
    std::unique_ptr<ServerLease> lease;
    std::optional<LeaseWish> wish = options.lease;
    if (wish) wish->newest_schema = newest_schema_version();
    const bool leased = has_lease(*std::make_unique<PostgresConnection>(options.address));
    // Before the migration: a newer server that stands by leaves the tables as they are until it is its turn.
    if (wish && leased) {
      BOOST_OUTCOME_TRY(lease, ServerLease::take(options.address, *wish));
    }
    PostgresConnection connection(options.address);
    BOOST_OUTCOME_TRYV(sql::migrate_postgres(connection, postgresql_migrations(), SystemClock{}.now()));
    BOOST_OUTCOME_TRYV(sql::check_copy_is_whole(connection, sql::k_unfinished_in_postgres));
    // Rows of a flight would seem to be gone.
    if (folder->had_database() && folder->postgres().empty() && !has_rows(connection)) {
      return make_error(
          Errc::unsupported,
          "data folder " + options.data_dir.string() + " has an SQLite database of its own and " +
              sql::shown_address(options.address) +
              " is empty: copy the rows with 'anchord database copy', or give another --data-dir");
    }
    BOOST_OUTCOME_TRYV(folder->note_postgres(sql::shown_address(options.address)));
    if (wish && !lease) {
      BOOST_OUTCOME_TRY(lease, ServerLease::take(options.address, *wish));
    }
    return std::unique_ptr<Database>(
        std::make_unique<PostgresDatabase>(options, std::move(folder), std::move(lease)));
  } catch (const SqlError& error) {
    return sql::to_error(error);
  }
}

Result<PostgresFacts> look_at_postgres(const std::string& address) {
  BOOST_OUTCOME_TRYV(check_address(address));
  try {
    PostgresConnection connection(address);
    PostgresFacts facts;
    connection.execute("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY");
    sql::Query query(connection, k_facts);
    if (query.step()) {
      facts.server_version = query.text();
      facts.bytes = query.as<std::uint64_t>();
    }
    facts.schema_version = sql::postgres_version(connection);
    if (has_lease(connection)) {
      sql::Query who(connection, k_who);
      if (who.step()) {
        facts.server = who.text();
        facts.standby = who.text();
      }
    }
    connection.execute("ROLLBACK");
    return facts;
  } catch (const SqlError& error) {
    return sql::to_error(error);
  }
}

Result<std::unique_ptr<Database>> open_store(const std::string& address, const StorageOptions& options,
                                             std::optional<LeaseWish> lease) {
  if (address.empty()) return open_database(options);
  PostgresOptions postgres;
  postgres.address = address;
  postgres.data_dir = options.data_dir;
  postgres.readers = options.readers;
  postgres.max_queued_rows = options.max_queued_rows;
  postgres.max_queued_calls = options.max_queued_calls;
  postgres.lease = std::move(lease);
  return open_postgres(postgres);
}

}  // namespace anchord
