#pragma once

#include <span>

#include "migrations/migration.hpp"
#include "server/storage/postgres_connection.hpp"

namespace anchord::sql {

/// Brings the database to the newest version: all steps that are missing in one transaction, beside which no
/// other server migrates. Errors: unsupported when it is newer than this program, was made by steps that are
/// not this program's, or has tables that are not anchord's; nothing was changed then.
Result<void> migrate_postgres(PostgresConnection& connection, std::span<const Migration> migrations,
                              UtcTime now);

/// Why a program that supports versions up to `newest` leaves this database alone.
Error newer_database(int version, int newest);

/// The newest step that was applied; 0: none.
int postgres_version(PostgresConnection& connection);

}  // namespace anchord::sql
