#include "server/storage/postgres_migrate.hpp"

#include "server/storage/migrate.hpp"

namespace anchord::sql {
namespace {

// A lock of the transaction, not of the session: it goes with a server that dies, also behind a pooler. No
// statement time-out: a step may rewrite a large table.
constexpr const char* k_begin =
    "BEGIN ISOLATION LEVEL READ COMMITTED; SET LOCAL statement_timeout = 0; SET LOCAL lock_timeout = '60s'";
constexpr const char* k_postgres_migrate_lock = "SELECT pg_advisory_xact_lock(?1) IS NULL";
constexpr const char* k_has_versions = "SELECT to_regclass('schema_migration') IS NOT NULL";
constexpr const char* k_tables =
    "SELECT count(*) FROM pg_class WHERE relkind IN ('r', 'p', 'v') AND relnamespace = "
    "(SELECT oid FROM pg_namespace WHERE nspname = current_schema())";
constexpr const char* k_postgres_migrate_applied =
    "SELECT number, name, sha256_hex FROM schema_migration ORDER BY number";
constexpr const char* k_postgres_migrate_record =
    "INSERT INTO schema_migration (number, name, sha256_hex, applied_t_ns) VALUES (?1, ?2, ?3, ?4)";

std::int64_t number(PostgresConnection& connection, const char* text) {
  Query query(connection, text);
  return query.step() ? query.integer() : 0;
}

/// How many steps were applied; that each of them is ours.
Result<std::size_t> applied(PostgresConnection& connection, std::span<const Migration> migrations) {
  if (number(connection, k_has_versions) == 0) {
    if (number(connection, k_tables) == 0) return std::size_t{0};
    return make_error(Errc::unsupported,
                      "the database has tables of another program: use a database for anchord alone");
  }
  Query query(connection, k_postgres_migrate_applied);
  std::size_t n = 0;
  while (query.step()) {
    const auto number = query.integer();
    const auto name = query.text();
    const auto digest = query.text();
    if (static_cast<std::size_t>(number) != ++n)
      return make_error(Errc::unsupported, "the database has no migration " + std::to_string(n));
    if (n <= migrations.size() && digest != sha256_hex(migrations[n - 1].sql)) {
      return make_error(Errc::unsupported,
                        "migration " + std::to_string(number) + " (" + name +
                            ") is not the one with which this database was created: that one had SHA-256 " +
                            digest);
    }
  }
  if (n > migrations.size()) return newer_database(static_cast<int>(n), static_cast<int>(migrations.size()));
  return n;
}

void apply(PostgresConnection& connection, const Migration& migration, UtcTime now) {
  try {
    connection.execute(std::string(migration.sql));
    Query query(connection, k_postgres_migrate_record);
    query << migration.number << migration.name << sha256_hex(migration.sql) << now;
    query.run();
  } catch (const SqlError& error) {
    throw SqlError(error.failure(), "migration " + std::to_string(migration.number) + ": " + error.what());
  }
}

Result<void> bring_up(PostgresConnection& connection, std::span<const Migration> migrations, UtcTime now) {
  {
    Query lock(connection, k_postgres_migrate_lock);
    lock << k_application_id;
    lock.run();
  }
  BOOST_OUTCOME_TRY(const auto version, applied(connection, migrations));
  for (const Migration& migration : migrations.subspan(version)) apply(connection, migration, now);
  return boost::outcome_v2::success();
}

}  // namespace

Error newer_database(int version, int newest) {
  return make_error(Errc::unsupported, "the database has version " + std::to_string(version) +
                                           "; this anchord supports versions up to " +
                                           std::to_string(newest) + ". Use the newer anchord");
}

int postgres_version(PostgresConnection& connection) {
  if (number(connection, k_has_versions) == 0) return 0;
  return static_cast<int>(number(connection, "SELECT max(number) FROM schema_migration"));
}

Result<void> migrate_postgres(PostgresConnection& connection, std::span<const Migration> migrations,
                              UtcTime now) {
  connection.execute(k_begin);
  try {
    auto done = bring_up(connection, migrations, now);
    if (done)
      connection.commit();
    else
      connection.execute("ROLLBACK");
    return done;
  } catch (const SqlError&) {
    if (connection.usable() && connection.in_transaction()) connection.execute("ROLLBACK");
    throw;
  }
}

}  // namespace anchord::sql
