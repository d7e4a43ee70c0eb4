#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>

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
};

/// Opens the database of an address and migrates it; the stores are those of SQLite. A backup is pg_dump's,
/// so backup() refuses. Errors: invalid_argument (no address, or one with a password), conflict (another
/// process has the folder), unsupported (made by a newer anchord, or not by anchord), storage_unavailable.
Result<std::unique_ptr<Database>> open_postgres(const PostgresOptions& options);

}  // namespace anchord
