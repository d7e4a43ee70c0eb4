#include "server/storage/migrate.hpp"

#include <system_error>

#include "core/base/check.hpp"
#include "core/base/sha256.hpp"
#include "server/storage/data_folder.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_migrate_applied =
    "SELECT number, name, sha256_hex FROM schema_migration ORDER BY number";
constexpr const char* k_migrate_record =
    "INSERT INTO schema_migration (number, name, sha256_hex, applied_t_ns) VALUES (?1, ?2, ?3, ?4)";

std::string quoted(std::string text) {
  for (std::size_t at = text.find('\''); at != std::string::npos; at = text.find('\'', at + 2))
    text.insert(at, 1, '\'');
  return "'" + text + "'";
}

Result<void> copy_before(SqliteConnection& connection, const std::filesystem::path& dir,
                         std::int64_t version) {
  std::error_code ignored;
  std::filesystem::create_directories(dir, ignored);
  const auto file = dir / ("before-migration-" + std::to_string(version + 1) + ".db");
  // Left by a start that was killed: it may be half a copy.
  std::filesystem::remove(file, ignored);
  connection.execute("VACUUM INTO " + quoted(file.string()));
  // SQLite does not sync what it vacuums into; the migration that follows is synced, and this is its way
  // back.
  BOOST_OUTCOME_TRYV(sync_path(file));
  BOOST_OUTCOME_TRYV(sync_path(dir));
  return sync_path(std::filesystem::absolute(dir).parent_path());  // the folder may be new too
}

Result<void> verify_applied(SqliteConnection& connection, std::span<const Migration> migrations) {
  Query query(connection, k_migrate_applied);
  while (query.step()) {
    const auto number = query.integer();
    const auto name = query.text();
    const auto digest = query.text();
    if (number < 1 || static_cast<std::size_t>(number) > migrations.size()) continue;
    if (digest != sha256_hex(migrations[static_cast<std::size_t>(number - 1)].sql)) {
      return make_error(Errc::unsupported,
                        "migration " + std::to_string(number) + " (" + name +
                            ") is not the one with which this database was created: that one had SHA-256 " +
                            digest);
    }
  }
  return boost::outcome_v2::success();
}

void apply(SqliteConnection& connection, const Migration& migration, UtcTime now) {
  connection.execute("BEGIN IMMEDIATE");
  try {
    connection.execute(std::string(migration.sql));
    {
      Query query(connection, k_migrate_record);
      query << migration.number << migration.name << sha256_hex(migration.sql) << now;
      query.run();
    }
    connection.execute("PRAGMA user_version=" + std::to_string(migration.number));
    connection.execute("COMMIT");
  } catch (const SqlError& error) {
    if (connection.in_transaction()) connection.execute("ROLLBACK");
    throw SqlError(error.failure(), "migration " + std::to_string(migration.number) + ": " + error.what());
  }
}

}  // namespace

std::string sha256_hex(std::string_view bytes) {
  Sha256 sum;
  sum.add(bytes);
  return sum.hex();
}

Result<void> migrate(SqliteConnection& connection, std::span<const Migration> migrations,
                     const std::filesystem::path& backup_dir, UtcTime now) {
  const std::int64_t version = connection.pragma("user_version");
  const auto newest = static_cast<std::int64_t>(migrations.size());
  ANCHORD_CHECK(version <= newest, "the database to migrate is of a newer version: " << version);
  if (version > 0) {
    BOOST_OUTCOME_TRY(verify_applied(connection, migrations));
  }
  if (version == newest) return boost::outcome_v2::success();
  if (version > 0) {
    BOOST_OUTCOME_TRYV(copy_before(connection, backup_dir, version));
  }
  for (const Migration& migration : migrations.subspan(static_cast<std::size_t>(version))) {
    apply(connection, migration, now);
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::sql
