#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>
#include <thread>

#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "tests/server/storage/child.hpp"
#include "tests/server/storage/store_contract.hpp"
#include "tests/server/storage/stuck_disk.hpp"

namespace anchord::failure_test {
namespace {

/// Counted row by row: a count by a flight's radios would not miss one that is gone.
MeasurementStore::Filter rows_of(const MissionId& mission) {
  MeasurementStore::Filter filter;
  filter.mission = mission;
  filter.since = UtcTime{0};  // of a whole mission the kept count is the answer
  return filter;
}

using testing::HasSubstr;

struct Raw {
  explicit Raw(const std::filesystem::path& file) { sqlite3_open(file.c_str(), &db); }
  ~Raw() { sqlite3_close(db); }
  Raw(const Raw&) = delete;
  Raw& operator=(const Raw&) = delete;
  void run(const char* sql) {
    ASSERT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(db);
  }
  sqlite3* db{nullptr};
};

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class StorageFailure : public testing::Test {
 protected:
  StorageFailure() {
    options_.data_dir = dir_.path() / "data";
    options_.reserve_bytes = 0;
  }
  std::filesystem::path file() const { return options_.data_dir / "anchord.db"; }
  std::unique_ptr<Database> open() {
    auto db = open_database(options_);
    EXPECT_TRUE(db) << db.error().message;
    return db ? std::move(db).value() : nullptr;
  }
  Error open_error() {
    auto db = open_database(options_);
    EXPECT_FALSE(db);
    return db ? Error{} : db.error();
  }
  static Mission mission_in(Database& db) {
    Mission m;
    m.id = MissionId{make_uuid_v7(k_noon)};
    EXPECT_TRUE(db.stores().missions.insert(m));
    return m;
  }
  static std::vector<Range> batch(const MissionId& mission, int from, int n) {
    std::vector<Range> rows;
    for (int i = 0; i < n; ++i) rows.push_back(range_at(mission, from + i));
    return rows;
  }
  /// A folder with one mission of `n` ranges, closed again.
  MissionId filled(int n) {
    auto db = open();
    const auto m = mission_in(*db);
    EXPECT_TRUE(db->stores().measurements.append_ranges(batch(m.id, 0, n), false));
    return m.id;
  }
  ScratchDir dir_;
  StorageOptions options_;
};

TEST_F(StorageFailure, RefusesASecondInstanceAndNamesTheFirst) {
  const auto first = open();
  const Error error = open_error();
  EXPECT_EQ(error.code, Errc::conflict);
  EXPECT_THAT(error.message, HasSubstr(std::to_string(::getpid())));
}

/// A lock file looks left over, and people delete those.
TEST_F(StorageFailure, RefusesASecondInstanceAlsoWhenTheLockFileWasDeleted) {
  const auto first = open();
  ASSERT_TRUE(std::filesystem::remove(options_.data_dir / "anchord.lock"));
  EXPECT_EQ(open_error().code, Errc::conflict);
}

TEST_F(StorageFailure, KeepsItsFilesFromOtherUsers) {
  filled(1);
  struct stat info {};
  ASSERT_EQ(::stat(options_.data_dir.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
  ASSERT_EQ(::stat(file().c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0077, 0u);
}

TEST_F(StorageFailure, AnswersStorageFullAtTheQuotaAndKeepsWhatItAcknowledged) {
  options_.max_pages = 160;
  MissionId mission;
  int acknowledged = 0;
  {
    const auto db = open();
    mission = mission_in(*db).id;
    Result<std::vector<RowOutcome>> result = std::vector<RowOutcome>{};
    while (acknowledged < 100'000 &&
           (result = db->stores().measurements.append_ranges(batch(mission, acknowledged, 500), false))) {
      acknowledged += 500;
    }
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, Errc::storage_full) << result.error().message;
    EXPECT_EQ(db->health().level, StorageLevel::full);
    EXPECT_FALSE(db->health().writable());
    EXPECT_EQ(db->stores().measurements.count_ranges(rows_of(mission)).value(),
              static_cast<std::uint64_t>(acknowledged));
  }
  options_.max_pages.reset();
  const auto db = open();
  EXPECT_EQ(db->stores().measurements.count_ranges(rows_of(mission)).value(),
            static_cast<std::uint64_t>(acknowledged));
  EXPECT_TRUE(db->stores().measurements.append_ranges(batch(mission, acknowledged, 500), false));
  EXPECT_EQ(db->health().level, StorageLevel::ok);
}

TEST_F(StorageFailure, AnswersStorageFullWhenTheFileMayNotGrow) {
  const MissionId mission = filled(10);
  Child child([&](int) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{2u << 20, 2u << 20};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    auto db = open_database(options_);
    if (!db) return 2;
    for (int i = 10; i < 200'000; i += 1000) {
      const auto result = db.value()->stores().measurements.append_ranges(batch(mission, i, 1000), false);
      if (result) continue;
      const bool reads = db.value()->stores().measurements.count_ranges(rows_of(mission)).has_value();
      return result.error().code == Errc::storage_full && reads ? 0 : 3;
    }
    return 4;
  });
  EXPECT_EQ(child.wait(), 0);
  const auto db = open();
  EXPECT_GE(db->stores().measurements.count_ranges(rows_of(mission)).value(), 10u);
}

TEST_F(StorageFailure, GivesUpItsReserveBeforeItAnswersFull) {
  options_.reserve_bytes = 1u << 20;
  options_.max_pages = 160;
  const auto db = open();
  const auto reserve = options_.data_dir / "reserve.bin";
  EXPECT_EQ(std::filesystem::file_size(reserve), options_.reserve_bytes);
  const auto mission = mission_in(*db);
  for (int i = 0; i < 100'000 && db->stores().measurements.append_ranges(batch(mission.id, i, 500), false);
       i += 500) {
    EXPECT_TRUE(std::filesystem::exists(reserve));
  }
  EXPECT_FALSE(std::filesystem::exists(reserve));
}

// Where a file system cannot set space aside, it is filled byte by byte: nothing that alarms and heartbeats
// wait for.
TEST_F(StorageFailure, MakesItsReserveAnewWhenNothingIsWrittenAndNobodyAsks) {
  options_.reserve_bytes = 1u << 20;
  options_.warn_free_bytes = 0;
  const auto db = open();
  const auto reserve = options_.data_dir / "reserve.bin";
  ASSERT_TRUE(std::filesystem::remove(reserve));
  std::error_code error;
  for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
       std::filesystem::file_size(reserve, error) != options_.reserve_bytes &&
       std::chrono::steady_clock::now() < end;) {
    std::this_thread::yield();
  }
  EXPECT_EQ(std::filesystem::file_size(reserve, error), options_.reserve_bytes);
}

TEST_F(StorageFailure, TakesNoNewMissionWhenSpaceIsScarceButRowsOfARunningOne) {
  const MissionId mission = filled(1);
  options_.refuse_free_bytes = std::uint64_t{1} << 60;
  options_.warn_free_bytes = std::uint64_t{1} << 60;
  const auto db = open();
  EXPECT_EQ(db->health().level, StorageLevel::disk_scarce);
  EXPECT_TRUE(db->health().writable());
  Mission m;
  m.id = MissionId{make_uuid_v7(k_noon)};
  EXPECT_EQ(db->stores().missions.insert(m).error().code, Errc::storage_full);
  EXPECT_TRUE(db->stores().measurements.append_ranges(batch(mission, 1, 1), false));
}

TEST_F(StorageFailure, WarnsWhenSpaceGetsLow) {
  options_.warn_free_bytes = std::uint64_t{1} << 60;
  EXPECT_EQ(open()->health().level, StorageLevel::disk_low);
}

TEST_F(StorageFailure, RefusesAReadOnlyFileAsUnavailable) {
  filled(1);
  const auto user = ::geteuid() == 0 ? uid_t{65534} : ::geteuid();
  ::chmod(dir_.path().c_str(), 0755);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(dir_.path())) {
    ASSERT_EQ(::chown(entry.path().c_str(), user, static_cast<gid_t>(-1)), 0);
  }
  ::chmod(file().c_str(), 0444);
  const std::string before = bytes_of(file());
  Child child([&](int) {
    if (::geteuid() == 0 && ::setuid(user) != 0) return 2;  // root may write everywhere
    const auto db = open_database(options_);
    return !db && db.error().code == Errc::storage_unavailable ? 0 : 3;
  });
  EXPECT_EQ(child.wait(), 0);
  EXPECT_EQ(bytes_of(file()), before);
}

TEST_F(StorageFailure, RefusesADamagedPageWithTheCommandsThatRecover) {
  filled(5000);
  {
    std::fstream io(file(), std::ios::binary | std::ios::in | std::ios::out);
    // Pages in the middle of the tree of measurements, far from the header.
    io.seekp(static_cast<std::streamoff>(std::filesystem::file_size(file()) / 2 / 8192 * 8192));
    io << std::string(8192, '\x5a');
  }
  const std::string before = bytes_of(file());
  const Error error = open_error();
  EXPECT_EQ(error.code, Errc::storage_unavailable);
  EXPECT_THAT(error.message, HasSubstr("cp -a"));
  EXPECT_THAT(error.message, HasSubstr(".dump"));
  EXPECT_THAT(error.message, HasSubstr("backups"));
  EXPECT_EQ(bytes_of(file()), before);
}

TEST_F(StorageFailure, NeverStartsAfreshWhereADatabaseWas) {
  filled(10);
  std::filesystem::resize_file(file(), 0);
  EXPECT_EQ(open_error().code, Errc::storage_unavailable);
  EXPECT_EQ(std::filesystem::file_size(file()), 0u);
  std::filesystem::remove(file());
  EXPECT_THAT(open_error().message, HasSubstr("missing"));
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(StorageFailure, RefusesAFileThatIsNoDatabase) {
  filled(10);
  std::ofstream(file(), std::ios::binary) << std::string(100'000, 'x');
  EXPECT_EQ(open_error().code, Errc::storage_unavailable);
}

TEST_F(StorageFailure, RefusesANewerVersionAndLeavesItAlone) {
  filled(10);
  Raw(file()).run("PRAGMA user_version = 9999");
  const std::string before = bytes_of(file());
  const Error error = open_error();
  EXPECT_EQ(error.code, Errc::unsupported);
  EXPECT_THAT(error.message, HasSubstr("9999"));
  EXPECT_EQ(bytes_of(file()), before);
}

TEST_F(StorageFailure, RefusesADatabaseOfAnotherProgram) {
  std::filesystem::create_directories(options_.data_dir);
  Raw(file()).run("CREATE TABLE t (x)");
  const std::string before = bytes_of(file());
  EXPECT_EQ(open_error().code, Errc::unsupported);
  EXPECT_EQ(bytes_of(file()), before);
}

TEST_F(StorageFailure, AnswersUnavailableWhileAnotherProcessHoldsTheLockAndRecovers) {
  const auto db = open();
  const auto mission = mission_in(*db);
  Raw other(file());
  other.run("BEGIN IMMEDIATE");
  const auto refused = db->stores().measurements.append_ranges(batch(mission.id, 0, 1), false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::storage_unavailable);
  EXPECT_EQ(db->health().level, StorageLevel::unavailable);
  EXPECT_TRUE(db->stores().missions.mission(mission.id)) << "reads go on";
  other.run("ROLLBACK");
  Result<std::vector<RowOutcome>> taken = std::vector<RowOutcome>{};
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  do {
    taken = db->stores().measurements.append_ranges(batch(mission.id, 0, 1), false);
  } while (!taken && std::chrono::steady_clock::now() < deadline);
  EXPECT_TRUE(taken);
  EXPECT_EQ(db->health().level, StorageLevel::ok);
}

/// SQLite goes on writing to a file that was taken away, without an error: rows would be acknowledged that
/// nobody finds again.
TEST_F(StorageFailure, AcknowledgesNothingOnceItsFolderWasRemovedAndSavesWhatItHad) {
  MissionId mission;
  {
    const auto db = open();
    mission = mission_in(*db).id;
    ASSERT_TRUE(db->stores().measurements.append_ranges(batch(mission, 0, 50), false));
    std::filesystem::remove_all(options_.data_dir);
    const auto refused = db->stores().measurements.append_ranges(batch(mission, 50, 50), false);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::storage_unavailable);
    EXPECT_THAT(refused.error().message, HasSubstr("anchord.db was removed, renamed or replaced"));
    EXPECT_FALSE(db->health().writable());
  }
  const std::filesystem::path saved = file().string() + ".saved-1";
  const Error missing = open_error();
  EXPECT_THAT(missing.message, HasSubstr("anchord backup restore '" + saved.string() + "'"));
  ASSERT_TRUE(restore_backup(options_.data_dir, saved));
  EXPECT_EQ(open()->stores().measurements.count_ranges(rows_of(mission)).value(), 50U);
}

TEST_F(StorageFailure, NoticesAFileThatWasReplacedAlsoWhenNobodyWritesAndGoesOnWhenItIsBack) {
  const auto db = open();
  const auto mission = mission_in(*db);
  ASSERT_TRUE(db->stores().measurements.append_ranges(batch(mission.id, 0, 5), false));
  const auto until = [&](StorageLevel level) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (db->health().level != level && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return db->health().level == level;
  };
  const std::filesystem::path aside = options_.data_dir / "aside.db", copy = options_.data_dir / "copy.db";
  ASSERT_TRUE(db->backup(copy));
  std::filesystem::rename(file(), aside);
  std::filesystem::rename(copy, file());
  EXPECT_TRUE(until(StorageLevel::unavailable));
  EXPECT_FALSE(db->backup(options_.data_dir / "of_another.db")) << "the file of that name is another";
  std::filesystem::rename(aside, file());
  EXPECT_TRUE(until(StorageLevel::ok));
  EXPECT_TRUE(db->stores().measurements.append_ranges(batch(mission.id, 5, 5), false));
  EXPECT_EQ(db->stores().measurements.count_ranges(rows_of(mission.id)).value(), 10U);
}

/// Until the next checkpoint the newest commits are in the log alone.
TEST_F(StorageFailure, AcknowledgesNothingOnceItsLogWasRemoved) {
  const auto db = open();
  const auto mission = mission_in(*db);
  ASSERT_TRUE(std::filesystem::remove(file().string() + "-wal"));
  const auto refused = db->stores().measurements.append_ranges(batch(mission.id, 0, 5), false);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("anchord.db-wal was removed, renamed or replaced"));
}

/// Nothing fails while a disk hangs, so nothing but time tells of it.
TEST_F(StorageFailure, SaysThatAWriteIsStalledWhileTheDiskHangsAndLosesNothing) {
  StuckDisk disk;
  const auto db = open();
  const auto mission = mission_in(*db);
  EXPECT_EQ(db->health().level, StorageLevel::ok);
  StuckDisk::stuck = true;
  std::atomic<bool> stored{false};
  std::thread writer([&] {
    const auto taken = db->stores().measurements.append_ranges(batch(mission.id, 0, 5), false);
    stored = taken.has_value();
  });
  const auto until = [&](StorageLevel level) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (db->health().level != level && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return db->health().level == level;
  };
  EXPECT_TRUE(until(StorageLevel::stalled));
  EXPECT_THAT(db->health().reason, HasSubstr("has not taken a write for"));
  EXPECT_FALSE(stored) << "what is not on the disk is not acknowledged";
  StuckDisk::stuck = false;
  writer.join();
  EXPECT_TRUE(stored);
  EXPECT_TRUE(until(StorageLevel::ok));
  EXPECT_EQ(db->stores().measurements.count_ranges(rows_of(mission.id)).value(), 5U);
}

TEST_F(StorageFailure, AnswersQueueFullBeyondTheBoundAndLosesNothingOfTheRest) {
  options_.max_queued_rows = 100;
  const auto db = open();
  const auto mission = mission_in(*db);
  Raw other(file());
  other.run("BEGIN IMMEDIATE");
  std::atomic<int> taken{0};
  std::atomic<int> refused{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < 6; ++t) {
    threads.emplace_back([&, t] {
      const auto result = db->stores().measurements.append_ranges(batch(mission.id, t * 40, 40), false);
      if (result) ++taken;
      if (!result && result.error().code == Errc::queue_full) ++refused;
    });
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(4);
  while (refused == 0 && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  other.run("ROLLBACK");
  for (auto& thread : threads) thread.join();
  EXPECT_GE(refused, 1);
  EXPECT_EQ(taken + refused, 6);
  EXPECT_EQ(db->stores().measurements.count_ranges(rows_of(mission.id)).value(),
            static_cast<std::uint64_t>(taken * 40));
}

TEST_F(StorageFailure, KeepsEveryAcknowledgedBatchWhenKilledAtRandomMoments) {
  const MissionId mission = filled(0);
  std::mt19937 random(7);
  int acknowledged = 0;
  for (int round = 0; round < 15; ++round) {
    Child child([&](int out) {
      auto db = open_database(options_);
      if (!db) return 1;
      for (int i = acknowledged;; ++i) {
        if (!db.value()->stores().measurements.append_ranges(batch(mission, i * 20, 20), false)) return 2;
        if (::write(out, "x", 1) != 1) return 3;
      }
    });
    const int wanted = static_cast<int>(random() % 60);
    for (int i = 0; i < wanted && child.read_byte(); ++i) ++acknowledged;
    child.kill_now();
    while (child.read_byte()) ++acknowledged;  // written before the end: acknowledged as well
    const auto db = open();
    ASSERT_NE(db, nullptr);
    const auto stored = db->stores().measurements.count_ranges(rows_of(mission)).value();
    ASSERT_GE(stored, static_cast<std::uint64_t>(acknowledged) * 20);
    ASSERT_EQ(stored % 20, 0u) << "half a batch";
    acknowledged = static_cast<int>(stored / 20);
  }
  EXPECT_GT(acknowledged, 0);
}

TEST_F(StorageFailure, BacksUpUnderLoadACopyThatPassesItsChecks) {
  const auto db = open();
  const auto mission = mission_in(*db);
  ASSERT_TRUE(db->stores().measurements.append_ranges(batch(mission.id, 0, 3000), false));
  std::atomic<bool> stop{false};
  std::thread writer([&] {
    for (int i = 3000; !stop; i += 10)
      EXPECT_TRUE(db->stores().measurements.append_ranges(batch(mission.id, i, 10), false));
  });
  const auto copy = dir_.path() / "copy.db";
  const auto report = db->backup(copy);
  stop = true;
  writer.join();
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_EQ(report.value().bytes, std::filesystem::file_size(copy));
  std::string line;
  std::getline(std::ifstream(copy.string() + ".sha256") >> std::ws, line);
  EXPECT_EQ(line, report.value().sha256_hex + "  copy.db");
  EXPECT_EQ(db->backup(copy).error().code, Errc::conflict);

  StorageOptions restored = options_;
  restored.data_dir = dir_.path() / "restored";
  std::filesystem::create_directories(restored.data_dir);
  std::filesystem::copy_file(copy, restored.data_dir / "anchord.db");
  const auto again = open_database(restored);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_GE(again.value()->stores().measurements.count_ranges(rows_of(mission.id)).value(), 3000u);
}

}  // namespace
}  // namespace anchord::failure_test
