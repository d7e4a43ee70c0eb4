#include "server/storage/database_copy.hpp"

#include <algorithm>

#include "core/base/text.hpp"
#include "migrations/migration.hpp"
#include "server/storage/cir_copies.hpp"
#include "server/storage/postgres_connection.hpp"
#include "server/storage/postgres_migrate.hpp"
#include "server/storage/postgres_text.hpp"
#include "server/storage/server_lease.hpp"
#include "server/storage/sqlite_file.hpp"

namespace anchord {
namespace {

using sql::Connection;
using sql::Query;
using sql::RowTable;
using sql::SqlError;

/// Has one row from the start, which a copy brings along.
constexpr std::string_view k_seeded = "service_state";

bool is_address(const std::string& place) { return place.find("://") != std::string::npos; }

/// A database at the newest version, and the lock of its folder.
struct Place {
  std::string shown;
  std::unique_ptr<sql::DataFolder> folder{};  ///< of SQLite
  std::unique_ptr<Connection> connection{};
  std::string server{};  ///< that writes into it; of PostgreSQL, where it is only read

  bool postgres() const { return folder == nullptr; }
  void begin_reading() const {
    connection->execute(postgres() ? "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY" : "BEGIN");
  }
  void begin_writing() const { connection->execute(postgres() ? "BEGIN" : "BEGIN IMMEDIATE"); }
  bool unfinished() const {
    Query query(*connection, postgres() ? sql::k_unfinished_in_postgres : sql::k_unfinished_in_sqlite);
    return query.step() && query.integer() > 0;
  }
};

/// What is done with a place: nothing but reading; changed; filled, from nothing if need be.
enum class Use { read, change, fill };

Error served(const Place& place, const std::string& server, const std::string& why) {
  return make_error(Errc::conflict,
                    "server " + server + " has " + place.shown + why +
                        ": stop it first ('systemctl stop anchord' on its machine; a standby "
                        "takes over, so stop that one before). One that was killed has it for "
                        "some seconds more");
}

/// A server that has it goes on by tables and rows that it knows.
Result<void> bring_up(Place& place, sql::PostgresConnection& connection, Use use) {
  const auto server = sql::serving_server(connection);
  if (!server) return sql::migrate_postgres(connection, postgresql_migrations(), SystemClock{}.now());
  if (use != Use::read) return served(place, *server, "");
  if (const int version = sql::postgres_version(connection); version != newest_schema_version())
    return served(
        place, *server,
        " at version " + std::to_string(version) + ", not " + std::to_string(newest_schema_version()));
  place.server = *server;
  return boost::outcome_v2::success();
}

Result<Place> open_postgres_place(const std::string& address, Use use) {
  Place place{sql::shown_address(address)};
  if (const auto fault = sql::address_fault(address); !fault.empty())
    return make_error(Errc::invalid_argument, place.shown + ": " + fault);
  auto connection = std::make_unique<sql::PostgresConnection>(address);
  BOOST_OUTCOME_TRYV(bring_up(place, *connection, use));
  place.connection = std::move(connection);
  return place;
}

Result<Place> open_folder(const std::string& dir, bool fill) {
  Place place{std::filesystem::absolute(dir).lexically_normal().string()};
  if (!fill && !std::filesystem::exists(std::filesystem::path(dir) / "anchord.db"))
    return make_error(Errc::not_found, "there is no anchord database in " + dir);
  BOOST_OUTCOME_TRY(place.folder, sql::DataFolder::open(dir, 0));
  // Rows come home into a folder whose own file is gone.
  if (fill && !place.folder->postgres().empty() && !std::filesystem::exists(place.folder->database()))
    place.folder->forget_database();
  BOOST_OUTCOME_TRYV(place.folder->check_rows_are_here());
  StorageOptions options;
  options.data_dir = dir;
  BOOST_OUTCOME_TRY(place.connection, sql::open_sqlite_file(options, *place.folder, true));
  return place;
}

Result<Place> open_place(const std::string& place, Use use, const ServedNotice& notice = {}) {
  if (!is_address(place)) return open_folder(place, use == Use::fill);
  BOOST_OUTCOME_TRY(auto opened, open_postgres_place(place, use));
  if (notice && !opened.server.empty()) notice(opened.shown, opened.server);
  return opened;
}

Result<void> ready(Place& to, const std::string& source, const std::vector<RowTable>& tables) {
  Connection& c = *to.connection;
  if (to.unfinished()) {
    Query begun(c, "SELECT source FROM unfinished_copy");
    const std::string before = begun.step() ? begun.text() : "";
    if (before == source) return boost::outcome_v2::success();
    return make_error(Errc::conflict, "a copy from " + before + " into " + to.shown +
                                          " was interrupted: finish that one, or give a new database");
  }
  for (const RowTable& table : tables) {
    if (table.name == k_seeded) continue;
    if (const auto rows = sql::count_rows(c, table); rows > 0) {
      return make_error(Errc::conflict, to.shown + " already has rows (" + std::to_string(rows) + " in " +
                                            table.name + "): a copy goes into an empty database; " +
                                            (to.postgres() ? "create one with createdb"
                                                           : "give a folder that does not exist yet"));
    }
  }
  to.begin_writing();
  c.execute("CREATE TABLE unfinished_copy (source TEXT)");
  Query note(c, "INSERT INTO unfinished_copy (source) VALUES (?1)");
  note << source;
  note.run();
  c.execute("DELETE FROM " + std::string(k_seeded));
  c.execute("COMMIT");
  return boost::outcome_v2::success();
}

Result<void> copy_table(Place& from, Place& to, const RowTable& table, const CopyProgress& progress) {
  sql::RowPages pages(*from.connection, table);
  pages.begin_after(sql::last_key(*to.connection, table));
  std::uint64_t rows = 0;
  for (auto page = pages.next(); !page.empty(); page = pages.next()) {
    to.begin_writing();
    sql::insert_cells(*to.connection, table, page);
    to.connection->execute("COMMIT");
    rows += page.size();
    if (progress(table.name, rows)) continue;
    return make_error(Errc::canceled, "the copy was stopped; the same command continues it");
  }
  return boost::outcome_v2::success();
}

/// Keys that are given out from now on are beyond those that came along. SQLite looks for itself.
void set_keys(Place& to, const RowTable& table) {
  if (!to.postgres() || table.key.size() != 1 || table.types[table.key[0]] != RowTable::Type::integer) return;
  const std::string& key = table.columns[table.key[0]];
  Query query(*to.connection, "SELECT setval(pg_get_serial_sequence('" + table.name + "', '" + key +
                                  "'), (SELECT max(" + key + ") FROM " + table.name + "))");
  query.run();
}

std::vector<sql::TableDigest> digests(Place& place, const std::vector<RowTable>& tables) {
  std::vector<sql::TableDigest> out;
  for (const RowTable& table : tables) out.push_back(sql::digest_of(*place.connection, table));
  return out;
}

Result<std::vector<sql::TableDigest>> copy_rows(Place& from, Place& to, const std::vector<RowTable>& tables,
                                                const CopyProgress& progress) {
  from.begin_reading();
  for (const RowTable& table : tables) {
    BOOST_OUTCOME_TRYV(copy_table(from, to, table, progress));
    set_keys(to, table);
  }
  auto expected = digests(from, tables);
  const auto found = digests(to, tables);
  from.connection->execute("ROLLBACK");
  for (std::size_t i = 0; i < expected.size(); ++i) {
    if (expected[i] == found[i]) continue;
    return make_error(Errc::conflict, "table " + expected[i].table + " differs after the copy (" +
                                          std::to_string(expected[i].rows) + " rows, there " +
                                          std::to_string(found[i].rows) + "): " + from.shown +
                                          " was changed in the meantime; start again with a new database");
  }
  to.connection->execute("DROP TABLE unfinished_copy");
  return expected;
}

/// The files that the rows of `from` need, for the database that they go to.
Result<CopyReport> copy_cirs(Place& from, const Place& to, const CopyFolders& folders,
                             const CopyProgress& progress) {
  const auto folder_of = [](const Place& place, const std::filesystem::path& given) {
    const auto dir = place.postgres() ? given : place.folder->dir();
    return dir.empty() ? dir : place.postgres() ? dir / "cir-archive" : place.folder->cir_archive();
  };
  CopyReport out;
  const auto needed = sql::needed_cir_files(*from.connection);
  const auto source = folder_of(from, folders.from);
  out.cir_archive = folder_of(to, folders.to);
  if (out.cir_archive.empty()) out.cir_archive = source;
  if (out.cir_archive.empty() && !needed.empty() && !folders.without_cirs)
    return make_error(Errc::invalid_argument,
                      from.shown + " needs " + std::to_string(needed.size()) +
                          " files with impulse responses: name the data folder of its "
                          "server (--from-data-dir)");
  if (out.cir_archive.empty()) return out;
  const auto go_on = [&] { return progress("cir-archive", 0); };
  BOOST_OUTCOME_TRY(auto brought,
                    sql::bring_cir_files(needed, sql::CirFolder(source), sql::CirFolder(out.cir_archive),
                                         sql::Found::read, go_on));
  out.cirs = std::move(brought.report);
  if (out.cirs.missing.empty() || folders.without_cirs) return out;
  return make_error(Errc::not_found, "nothing was copied: of " + std::to_string(needed.size()) +
                                         " files with impulse responses " +
                                         std::to_string(out.cirs.missing.size()) +
                                         " are missing; the first: " + out.cirs.missing.front() +
                                         ". Name the data folder beside PostgreSQL (--from-data-dir, "
                                         "--to-data-dir), or copy without them (--without-cir-archive)");
}

/// SqlError never leaves this folder.
template <class F>
auto without_throwing(F work) -> decltype(work()) {
  try {
    return work();
  } catch (const SqlError& error) {
    return sql::to_error(error);
  }
}

}  // namespace

Result<int> migrate_database(const std::string& place) {
  return without_throwing([&]() -> Result<int> {
    BOOST_OUTCOME_TRYV(open_place(place, Use::change));
    return newest_schema_version();
  });
}

Result<std::vector<sql::TableDigest>> digest_database(const std::string& place, const ServedNotice& served) {
  return without_throwing([&]() -> Result<std::vector<sql::TableDigest>> {
    BOOST_OUTCOME_TRY(auto opened, open_place(place, Use::read, served));
    opened.begin_reading();
    return digests(opened, sql::row_tables());
  });
}

Result<CopyReport> copy_database(const std::string& from, const std::string& to, const CopyFolders& folders,
                                 const CopyProgress& progress, const ServedNotice& served) {
  return without_throwing([&]() -> Result<CopyReport> {
    BOOST_OUTCOME_TRY(auto source, open_place(from, Use::read, served));
    if (source.unfinished())
      return make_error(Errc::unsupported, "a copy into " + source.shown + " has not been finished");
    BOOST_OUTCOME_TRY(auto target, open_place(to, Use::fill));
    const auto tables = sql::row_tables();
    BOOST_OUTCOME_TRYV(ready(target, source.shown, tables));
    BOOST_OUTCOME_TRY(auto report, copy_cirs(source, target, folders, progress));
    BOOST_OUTCOME_TRY(report.tables, copy_rows(source, target, tables, progress));
    return report;
  });
}

Result<void> sql::check_copy_is_whole(Connection& connection, const char* exists) {
  Query query(connection, exists);
  if (!query.step() || query.integer() == 0) return boost::outcome_v2::success();
  return make_error(Errc::unsupported,
                    "a copy into this database has not been finished: run 'anchord database copy' again, or "
                    "create a new database");
}

}  // namespace anchord
