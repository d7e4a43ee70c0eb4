#pragma once

#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {

/// Copies the database behind `source` while others write, checks the copy and writes its SHA-256 beside it.
Result<BackupReport> back_up(SqliteConnection& source, const std::filesystem::path& file);

}  // namespace anchord::sql
