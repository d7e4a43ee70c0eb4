#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "server/storage/row_tables.hpp"
#include "server/storage/sqlite_database.hpp"

/// Whole databases: brought to a version, compared, moved between a file of SQLite and PostgreSQL. A place is
/// a data folder or postgresql://user@host/name. Nobody else may have the folder. Of a PostgreSQL that a
/// server has (its lease) nothing is changed: what would change it is a conflict that names the server, what
/// reads it says so.
namespace anchord {

/// Returns the version. Errors: those of open_database() and open_postgres(); conflict: a server has it.
Result<int> migrate_database(const std::string& place);

/// Called with a database that is only read, and the server that writes into it meanwhile.
using ServedNotice = std::function<void(const std::string& shown, const std::string& server)>;

/// Of every table, at one moment; of a database of an older version too, which is migrated first unless a
/// server has it (conflict).
Result<std::vector<sql::TableDigest>> digest_database(const std::string& place,
                                                      const ServedNotice& served = {});

/// Called after each table or some thousand rows; false ends the copy, which can be gone on with.
using CopyProgress = std::function<bool(const std::string& table, std::uint64_t rows)>;

/// The data folders of both, whose cir-archive has impulse responses. Empty: that of a folder is itself; of
/// a PostgreSQL it is not known where it is copied from, and the same folder goes on where it is copied to.
struct CopyFolders {
  std::filesystem::path from{}, to{};
  bool without_cirs{false};  ///< also where files of impulse responses are missing
};
struct CopyReport {
  std::vector<sql::TableDigest> tables;
  CirCopies cirs;
  std::filesystem::path cir_archive;  ///< where their files are, for the database that was copied to
};
/// Copies all rows of `from` into `to`, which has none, and compares both by digests. One that was cut off
/// goes on where it was; until it is whole, no server takes the database. The files of impulse responses that
/// the rows need are copied before them, and each is compared by its SHA-256. What else is no row (keys,
/// recordings) stays in its folder. Errors: conflict (`to` has rows; they differ in the end; another process
/// has the folder, or a server has `to`), not_found (files of impulse responses are missing), canceled, those
/// of the databases.
Result<CopyReport> copy_database(const std::string& from, const std::string& to, const CopyFolders& folders,
                                 const CopyProgress& progress, const ServedNotice& served = {});

namespace sql {
/// unsupported where a copy into this database has not come to its end. `exists` tells whether its table is
/// there.
Result<void> check_copy_is_whole(Connection& connection, const char* exists);
inline constexpr const char* k_unfinished_in_sqlite =
    "SELECT count(*) FROM sqlite_schema WHERE name = 'unfinished_copy'";
inline constexpr const char* k_unfinished_in_postgres =
    "SELECT count(*) FROM pg_class WHERE oid = to_regclass('unfinished_copy')";
}  // namespace sql

}  // namespace anchord
