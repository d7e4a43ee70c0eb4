#include "server/storage/sqlite_database.hpp"

#include <atomic>
#include <fstream>

#include "core/base/file_place.hpp"
#include "core/base/guard.hpp"
#include "migrations/migration.hpp"
#include "server/storage/backup.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/database_copy.hpp"
#include "server/storage/migrate.hpp"
#include "server/storage/reader_pool.hpp"
#include "server/storage/sqlite_connection.hpp"
#include "server/storage/sqlite_file.hpp"
#include "server/storage/stalled.hpp"
#include "server/storage/stores.hpp"
#include "server/storage/write_queue.hpp"

namespace anchord {
namespace {

using sql::Connection;
using sql::DataFolder;
using sql::SqlError;
using sql::SqliteConnection;
using Mode = SqliteConnection::Mode;

// Beyond this size a check at start takes longer than a start may; it then runs beside the first requests.
constexpr std::uint64_t k_check_at_start_bytes = 256u << 20;

std::uint64_t size_of(const std::filesystem::path& file) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(file, error);
  return error ? 0 : bytes;
}

std::string mebibytes(std::uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

class SqliteDatabase final : public Database, private sql::Gate {
 public:
  SqliteDatabase(StorageOptions options, std::unique_ptr<DataFolder> folder,
                 std::unique_ptr<SqliteConnection> writer, bool check_in_background)
      : options_(std::move(options)),
        folder_(std::move(folder)),
        writer_(std::move(writer), folder_->database(), [this] { return open_connection(Mode::read_write); },
                {[this] { return folder_->give_up_reserve(); },
                 [this] { folder_->fill_reserve(options_.warn_free_bytes); }},
                {options_.max_queued_rows, options_.max_queued_calls, options_.checkpoint_wal_bytes}),
        readers_([this] { return open_connection(Mode::read_only); }, options_.readers),
        cirs_(folder_->cir_archive()),
        kept_(
            *this, [this] { return admit_mission(); }, cirs_) {
    if (check_in_background) checker_ = Thread("anchord-check", [this] { check_in_background_thread(); });
  }
  ~SqliteDatabase() override {
    if (checker_.joinable()) checker_.join();
  }

  const Stores& stores() override { return kept_.ports; }
  CirArchive& cir_archive() override { return *kept_.cir_archive; }

  StorageHealth health() override {
    const auto status = writer_.status();
    StorageHealth health;
    health.queued_calls = status.queued_calls;
    health.queued_rows = status.queued_rows;
    health.commits = status.commits;
    health.rows_written = status.rows;
    health.last_commit_s = status.last_commit_s;
    health.db_bytes = size_of(folder_->database());
    health.wal_bytes = size_of(folder_->wal());
    health.disk_free_bytes = folder_->free_bytes();
    health.schema_version = newest_schema_version();
    health.synchronous = options_.synchronous;
    assess(health, status);
    return health;
  }

  Result<BackupReport> backup(const std::filesystem::path& file, const GoOn& go_on) override {
    try {
      const auto held = cirs_.hold();
      const auto source = open_connection(Mode::read_only);
      return sql::back_up(*source, file, &cirs_, go_on);
    } catch (const SqlError& error) {
      return sql::to_error(error);
    }
  }

 private:
  std::optional<Error> write(std::size_t rows, const sql::Work& work) override {
    return writer_.write(rows, work);
  }
  std::optional<Error> read(const sql::Work& work) override { return readers_.read(work); }
  std::optional<std::uint64_t> changes() const override { return counted_changes(); }

  std::unique_ptr<SqliteConnection> open_connection(Mode mode) const {
    // Another file of this name is not what is being served, and no backup of it.
    if (!place_.holds())
      throw SqlError(sql::Failure::unavailable,
                     "database: its file was removed, renamed or replaced while it is in use");
    return std::make_unique<SqliteConnection>(folder_->database(), mode, options_.synchronous,
                                              options_.max_pages);
  }

  std::optional<Error> admit_mission() const {
    const std::uint64_t free = folder_->free_bytes();
    if (free >= options_.refuse_free_bytes) return std::nullopt;
    return make_error(Errc::storage_full, "no new missions can start: " + mebibytes(free) + " free, " +
                                              mebibytes(options_.refuse_free_bytes) +
                                              " needed; a running one continues");
  }

  void assess(StorageHealth& health, const sql::WriteQueue::Status& status) const {
    const std::uint64_t free = health.disk_free_bytes;
    if (status.trouble) {
      health.level =
          status.trouble->failure() == sql::Failure::full ? StorageLevel::full : StorageLevel::unavailable;
      health.reason = status.trouble->what();
    } else if (damage_found_) {
      health.level = StorageLevel::unavailable;
      health.reason = "the check of the database found damage; see the log since the start";
    } else if (sql::note_stall(status.oldest_s,
                               "the disk does not respond, or another program has locked the database",
                               health)) {
      return;
    } else if (free < options_.refuse_free_bytes) {
      health.level = StorageLevel::disk_scarce;
      health.reason = mebibytes(free) + " free on the disk: no new mission can start";
    } else if (free < options_.warn_free_bytes) {
      health.level = StorageLevel::disk_low;
      health.reason = mebibytes(free) + " free on the disk";
    }
  }

  void check_in_background_thread() {
    try {
      damage_found_ = open_connection(Mode::read_only)->check(options_.full_check) != "ok";
    } catch (const SqlError&) {
      damage_found_ = true;
    }
  }

  const StorageOptions options_;
  std::atomic<bool> damage_found_{false};
  // In this order: readers close first, so that the writer is the last connection and empties the WAL; then
  // the lock.
  const std::unique_ptr<DataFolder> folder_;
  const FilePlace place_{folder_->database()};
  sql::WriteQueue writer_;
  sql::ReaderPool readers_;
  const sql::CirFolder cirs_;
  sql::SqlStores kept_;
  Thread checker_;
};

Error damaged(const DataFolder& folder, const std::string& what) {
  return make_error(Errc::storage_unavailable, "database " + folder.database().string() + ": " + what + "\n" +
                                                   folder.recovery_commands());
}

/// Looks without touching: is it ours, and not newer than we are? True when nothing was ever stored in it.
Result<bool> judge_file(const DataFolder& folder) {
  std::ifstream in(folder.database(), std::ios::binary);
  std::string magic(16, '\0');
  if (!in.read(magic.data(), 16) || magic != std::string("SQLite format 3\0", 16)) {
    return damaged(folder, "this is no longer a database");
  }
  // Only the very first start, before the WAL, has a journal; when it was killed, the journal must be undone
  // to read.
  const bool cut = std::filesystem::exists(folder.database().string() + "-journal");
  SqliteConnection look(folder.database(), cut ? Mode::inspect : Mode::read_only, Synchronous::full,
                        std::nullopt);
  const auto application = look.pragma("application_id");
  const auto version = look.pragma("user_version");
  if (version == 0 && application == 0 && look.pragma("schema_version") == 0) return true;
  if (application != sql::k_application_id) {
    return make_error(Errc::unsupported,
                      "database " + folder.database().string() + " was not made by anchord");
  }
  if (version > newest_schema_version()) {
    return make_error(Errc::unsupported,
                      "database " + folder.database().string() + " has version " + std::to_string(version) +
                          "; this anchord supports versions up to " +
                          std::to_string(newest_schema_version()) +
                          ". Use the newer anchord, or a copy from " + folder.backups().string());
  }
  return false;
}

}  // namespace

Result<std::unique_ptr<SqliteConnection>> sql::open_sqlite_file(const StorageOptions& options,
                                                                DataFolder& folder, bool check) {
  const std::uint64_t bytes = size_of(folder.database());
  // A copy that was saved from under a running server says so where the whole folder was taken away.
  const bool saved = size_of(folder.database().string() + ".saved-1") > 0;
  if (bytes == 0 && (folder.had_database() || saved || size_of(folder.wal()) > 0)) {
    return damaged(folder,
                   std::filesystem::exists(folder.database()) ? "the file is empty" : "the file is missing");
  }
  bool fresh = bytes == 0;
  if (!fresh) {
    BOOST_OUTCOME_TRY(fresh, judge_file(folder));
  }
  if (fresh && folder.had_database()) return damaged(folder, "it no longer contains any data");
  auto writer = std::make_unique<SqliteConnection>(folder.database(), fresh ? Mode::create : Mode::read_write,
                                                   options.synchronous, options.max_pages);
  if (writer->read_only_file()) {
    return make_error(Errc::storage_unavailable, "database " + folder.database().string() + " is read-only");
  }
  if (check && !fresh) {
    const std::string found = writer->check(options.full_check);
    if (found != "ok") return damaged(folder, "damaged: " + found);
  }
  BOOST_OUTCOME_TRY(sql::migrate(*writer, sqlite_migrations(), folder.backups(), SystemClock{}.now()));
  BOOST_OUTCOME_TRY(folder.note_database());
  return writer;
}

int newest_schema_version() { return static_cast<int>(sqlite_migrations().size()); }

Result<std::unique_ptr<Database>> open_database(const StorageOptions& options) {
  BOOST_OUTCOME_TRY(auto folder, DataFolder::open(options.data_dir, options.reserve_bytes));
  BOOST_OUTCOME_TRYV(folder->check_rows_are_here());
  try {
    const bool check = size_of(folder->database()) <= k_check_at_start_bytes;
    BOOST_OUTCOME_TRY(auto writer, sql::open_sqlite_file(options, *folder, check));
    BOOST_OUTCOME_TRYV(sql::check_copy_is_whole(*writer, sql::k_unfinished_in_sqlite));
    folder->fill_reserve(options.refuse_free_bytes);
    return std::unique_ptr<Database>(
        std::make_unique<SqliteDatabase>(options, std::move(folder), std::move(writer), !check));
  } catch (const SqlError& error) {
    if (error.failure() == sql::Failure::damaged) return damaged(*folder, error.what());
    return sql::to_error(error);
  }
}

}  // namespace anchord
