#pragma once

#include <filesystem>
#include <span>

#include "migrations/migration.hpp"
#include "server/storage/sqlite_connection.hpp"

namespace anchord::sql {

constexpr std::int64_t k_application_id = 0x414e4348;  // "ANCH"

/// Brings the database to the newest version, each step in one transaction with its version. A copy
/// (VACUUM INTO backup_dir) is made before the first step of a database that has one already.
/// Errors: unsupported when a step applied earlier is not the step of this program.
Result<void> migrate(SqliteConnection& connection, std::span<const Migration> migrations,
                     const std::filesystem::path& backup_dir, UtcTime now);

/// Lower-case hex.
std::string sha256_hex(std::string_view bytes);

}  // namespace anchord::sql
