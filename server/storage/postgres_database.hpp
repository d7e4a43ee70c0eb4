#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

#include "server/storage/server_lease.hpp"
#include "server/storage/sqlite_database.hpp"

namespace anchord {

struct PostgresOptions {
  /// postgresql://user@host/name, without a password: an address is shown in lists of processes and of
  /// settings. libpq takes the password from ~/.pgpass or PGPASSFILE.
  std::string address;
  std::filesystem::path data_dir;  ///< what is no row: keys, recordings; made with mode 0700 when absent
  std::size_t writers{4};          ///< connections that write
  std::size_t readers{16};         ///< connections that read
  std::size_t max_queued_rows{200'000};  ///< beyond it an append answers queue_full
  std::size_t max_queued_calls{1'000};
  std::chrono::milliseconds statement_timeout{30'000};
  std::optional<LeaseWish> lease{};  ///< of a server: it alone has the database, or waits until it has
};

/// Opens the database of an address and migrates it; the stores are those of SQLite. A backup is pg_dump's,
/// so backup() refuses. Errors: invalid_argument (no address, or one with a password), conflict (another
/// process has the folder, another server the database), canceled (while it stood by), unsupported (made by a
/// newer anchord, or not by anchord; the folder has rows of its own), storage_unavailable.
Result<std::unique_ptr<Database>> open_postgres(const PostgresOptions& options);

/// What can be seen of a database without changing it.
struct PostgresFacts {
  std::string server_version;  ///< "15.14"
  int schema_version{};        ///< 0: nothing of anchord's is in it yet
  std::uint64_t bytes{};
  std::string server, standby;  ///< who has it, and who waits for it; empty: nobody
};
/// Errors: invalid_argument, storage_unavailable.
Result<PostgresFacts> look_at_postgres(const std::string& address);

/// Opens where the rows are: the PostgreSQL of the address, or without one the folder's own file. For servers
/// and commands alike, so that none makes an empty database beside the one that is meant.
/// `lease`: of a server on PostgreSQL.
Result<std::unique_ptr<Database>> open_store(const std::string& address, const StorageOptions& options,
                                             std::optional<LeaseWish> lease = std::nullopt);

/// Why a command that copies SQLite's file does nothing for PostgreSQL.
inline constexpr const char* k_postgres_backups =
    "the rows are in PostgreSQL, which has backups of its own: pg_dump, or the archive of its WAL; see "
    "docs/postgresql.md";

}  // namespace anchord
