#include "server/storage/backup.hpp"

#include <sqlite3.h>

#include <chrono>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "core/base/sha256.hpp"
#include "server/storage/cir_copies.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/migrate.hpp"

namespace anchord::sql {
namespace {

// With the source read through its own snapshot, the copy never starts again however much is written
// meanwhile; the steps are small so that a copy on a slow card does not hold the file system for long at a
// time.
constexpr int k_pages_a_step = 512;

Result<void> copy_pages(SqliteConnection& source, const std::filesystem::path& file,
                        const Database::GoOn& go_on) {
  sqlite3* raw = nullptr;
  const int opened = sqlite3_open_v2(file.c_str(), &raw, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  const std::unique_ptr<sqlite3, int (*)(sqlite3*)> target(raw, sqlite3_close);
  if (opened != SQLITE_OK)
    return make_error(Errc::storage_unavailable, "backup: cannot make " + file.string());
  sqlite3_backup* const backup = sqlite3_backup_init(target.get(), "main", source.handle(), "main");
  if (backup == nullptr)
    return make_error(Errc::storage_unavailable, "backup: " + std::string(sqlite3_errmsg(raw)));
  int code = SQLITE_OK;
  int waits = 0;
  while (code == SQLITE_OK || ((code == SQLITE_BUSY || code == SQLITE_LOCKED) && ++waits < 100)) {
    if (code != SQLITE_OK) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    code = sqlite3_backup_step(backup, k_pages_a_step);
    if (code == SQLITE_OK && !go_on()) code = SQLITE_INTERRUPT;
  }
  sqlite3_backup_finish(backup);
  if (code == SQLITE_INTERRUPT) return make_error(Errc::canceled, "the backup was stopped");
  if (code == SQLITE_DONE) return boost::outcome_v2::success();
  const bool full = (code & 0xff) == SQLITE_FULL;
  return make_error(full ? Errc::storage_full : Errc::storage_unavailable,
                    "backup to " + file.string() + ": " + sqlite3_errstr(code));
}

/// "ok", or what is damaged. `needed`: null where the database is of an older version, or none of ours.
std::string check_copy(const std::filesystem::path& part, std::vector<NeededCirFile>* needed) {
  SqliteConnection copy(part, SqliteConnection::Mode::read_only, Synchronous::full, std::nullopt);
  auto found = copy.check(true);
  if (found == "ok" && needed != nullptr) *needed = needed_cir_files(copy);
  return found;
}

}  // namespace

Result<std::string> sha256_of_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  Sha256 digest;
  std::vector<char> chunk(1 << 16);
  while (in) {
    in.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    digest.add({chunk.data(), static_cast<std::size_t>(in.gcount())});
  }
  if (!in.eof()) return make_error(Errc::storage_unavailable, "cannot read back " + file.string());
  return digest.hex();
}

Result<BackupReport> back_up(SqliteConnection& source, const std::filesystem::path& file,
                             const CirFolder* cirs, const Database::GoOn& go_on) {
  std::error_code error;
  if (std::filesystem::exists(file, error))
    return make_error(Errc::conflict, "backup: " + file.string() + " exists");
  // Under another name until it is known to be good, so that a half copy never looks like a backup.
  const std::filesystem::path part = file.string() + ".part";
  std::filesystem::remove(part, error);
  if (const auto copied = copy_pages(source, part, go_on); !copied) {
    std::filesystem::remove(part, error);
    return copied.error();
  }
  std::vector<NeededCirFile> needed;
  const auto found = check_copy(part, cirs != nullptr ? &needed : nullptr);
  std::filesystem::remove(part.string() + "-wal", error);
  std::filesystem::remove(part.string() + "-shm", error);
  if (found != "ok") return make_error(Errc::storage_unavailable, "backup: the copy is damaged: " + found);
  BOOST_OUTCOME_TRY(sync_path(part));
  BackupReport report;
  BOOST_OUTCOME_TRY(report.sha256_hex, sha256_of_file(part));
  const CirFolder copies = copies_beside(file);
  auto brought = bring_cir_files(needed, cirs == nullptr ? copies : *cirs, copies, Found::listed, go_on);
  if (!brought) {
    std::filesystem::remove(part, error);
    return std::move(brought).error();
  }
  std::filesystem::rename(part, file, error);
  if (error) return make_error(Errc::storage_unavailable, "backup: " + error.message());
  BOOST_OUTCOME_TRY(write_backup_list(report, file, needed, brought.value()));
  const auto folder = std::filesystem::absolute(file).parent_path();
  BOOST_OUTCOME_TRY(sync_path(folder));
  // The folder may be new too. Where we may not look above it, somebody else made it, before.
  static_cast<void>(sync_path(folder.parent_path()));
  report.file = file;
  report.bytes = std::filesystem::file_size(file, error);
  report.cirs = std::move(brought).value().report;
  return report;
}

Result<std::filesystem::path> save_beside(SqliteConnection& source, const std::filesystem::path& database) {
  std::error_code error;
  std::filesystem::create_directories(database.parent_path(), error);
  const auto name = [&](int n) { return database.string() + ".saved-" + std::to_string(n); };
  int n = 1;
  while (std::filesystem::exists(name(n), error)) ++n;
  const auto made = back_up(source, name(n), nullptr, [] { return true; });
  if (made) return std::filesystem::path(name(n));
  // A disk that was too full for the copy keeps what it has left.
  for (const char* part : {".part", ".part-journal"}) std::filesystem::remove(name(n) + part, error);
  return made.error();
}

}  // namespace anchord::sql

namespace anchord {
namespace {

namespace fs = std::filesystem;

}  // namespace

Result<void> check_backup(const fs::path& backup) {
  std::error_code error;
  if (!fs::is_regular_file(backup, error)) return make_error(Errc::not_found, "no file " + backup.string());
  std::string expected;
  if (std::ifstream list(backup.string() + ".sha256"); list >> expected) {
    BOOST_OUTCOME_TRY(const auto found, sql::sha256_of_file(backup));
    if (found != expected)
      return make_error(Errc::unsupported,
                        backup.string() + " is not the file that was backed up: its SHA-256 differs");
  }
  try {
    sql::SqliteConnection copy(backup, sql::SqliteConnection::Mode::inspect, Synchronous::full, std::nullopt);
    if (copy.pragma("application_id") != sql::k_application_id)
      return make_error(Errc::unsupported, backup.string() + " is not an anchord database");
    if (copy.pragma("user_version") > newest_schema_version())
      return make_error(Errc::unsupported, backup.string() + " was created by a newer anchord");
    if (const auto found = copy.check(true); found != "ok")
      return make_error(Errc::unsupported, backup.string() + " is damaged: " + found);
  } catch (const std::exception& fault) {
    return make_error(Errc::unsupported, backup.string() + " is not a database: " + fault.what());
  }
  return boost::outcome_v2::success();
}

namespace {

/// Into the folder, where they are not there. What was copied is removed again where others are missing.
Result<CirCopies> restore_cirs(const sql::DataFolder& folder, const fs::path& backup, bool without_cirs) {
  BOOST_OUTCOME_TRY(const auto needed, sql::needed_by_backup(backup));
  BOOST_OUTCOME_TRY(auto brought, sql::bring_cir_files(needed, sql::copies_beside(backup),
                                                       sql::CirFolder(folder.cir_archive()), sql::Found::read,
                                                       [] { return true; }));
  const auto& missing = brought.report.missing;
  if (missing.empty() || without_cirs) return std::move(brought.report);
  std::error_code ignored;
  for (const auto& file : brought.made) fs::remove(file, ignored);
  return make_error(Errc::unsupported,
                    backup.string() + " is not complete: of " + std::to_string(needed.size()) +
                        " files with impulse responses " + std::to_string(missing.size()) +
                        " are missing; the first: " + missing.front() +
                        ". Copy them there; or restore without them (--without-cir-archive): all else of "
                        "these flights is in the backup");
}

/// Moves the database away that stands there, and returns where it is now.
Result<std::optional<fs::path>> move_away(const sql::DataFolder& folder) {
  std::error_code error;
  if (!fs::exists(folder.database(), error)) return std::optional<fs::path>{};
  fs::path place = folder.database().string() + ".before-restore";
  for (int n = 2; fs::exists(place, error); ++n)
    place = folder.database().string() + ".before-restore-" + std::to_string(n);
  for (const char* part : {"", "-wal", "-shm"}) {  // the WAL belongs to its database, not to the new one
    if (!fs::exists(folder.database().string() + part, error)) continue;
    fs::rename(folder.database().string() + part, place.string() + part, error);
    if (error)
      return make_error(Errc::storage_unavailable, "cannot move the old database away: " + error.message());
  }
  return std::optional(place);
}

}  // namespace

Result<Restored> restore_backup(const fs::path& data_dir, const fs::path& backup, bool without_cirs) {
  BOOST_OUTCOME_TRYV(check_backup(backup));  // first: a wrong name makes no folder
  BOOST_OUTCOME_TRY(const auto folder, sql::DataFolder::open(data_dir, 0));
  BOOST_OUTCOME_TRYV(folder->check_rows_are_here());
  Restored restored;
  BOOST_OUTCOME_TRY(restored.cirs, restore_cirs(*folder, backup, without_cirs));
  // Copied and synced beside the old one first: whenever the power goes, one whole database has the name or
  // stands beside it under a name that says what it is.
  const fs::path fresh = folder->database().string() + ".restored";
  std::error_code error;
  fs::remove(fresh, error);
  {
    // Not a file copy: what is put back may be a database that crashed, with rows in its WAL.
    sql::SqliteConnection source(backup, sql::SqliteConnection::Mode::inspect, Synchronous::full,
                                 std::nullopt);
    BOOST_OUTCOME_TRYV(sql::copy_pages(source, fresh, [] { return true; }));
  }
  for (const char* part : {"-wal", "-shm", "-journal"}) fs::remove(fresh.string() + part, error);
  fs::permissions(fresh, fs::perms::owner_read | fs::perms::owner_write, error);
  BOOST_OUTCOME_TRYV(sql::sync_path(fresh));
  BOOST_OUTCOME_TRY(restored.old, move_away(*folder));
  fs::rename(fresh, folder->database(), error);
  if (error)
    return make_error(Errc::storage_unavailable, "cannot copy the backup into place: " + error.message());
  BOOST_OUTCOME_TRYV(folder->note_database());
  BOOST_OUTCOME_TRYV(sql::sync_path(folder->dir()));
  return restored;
}

}  // namespace anchord
