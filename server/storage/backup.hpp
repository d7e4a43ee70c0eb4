#pragma once

#include "server/storage/cir_file.hpp"
#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {

/// Copies the database behind `source` while others write, checks the copy and writes its SHA-256 beside it.
/// cirs  the archive, whose files are copied too; null: the copy stays beside it
Result<BackupReport> back_up(SqliteConnection& source, const std::filesystem::path& file,
                             const CirFolder* cirs, const Database::GoOn& go_on);

/// The same to "<database>.saved-N", the first N that is free. Makes the folder again where it is gone, and
/// leaves nothing behind where it fails.
Result<std::filesystem::path> save_beside(SqliteConnection& source, const std::filesystem::path& database);

/// Of all its bytes. errors: storage_unavailable
Result<std::string> sha256_of_file(const std::filesystem::path& file);

}  // namespace anchord::sql
