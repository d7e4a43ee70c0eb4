// Files of impulse responses leave with a backup and with a copy of the whole database, and come back with
// it.
#include <fstream>

#include "core/base/sha256.hpp"
#include "core/ports/cir_archive.hpp"
#include "core/ports/mission_bin.hpp"
#include "server/storage/backup.hpp"
#include "server/storage/cir_copies.hpp"
#include "server/storage/database_copy.hpp"
#include "server/storage/sqlite_connection.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::cir_copies_test {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr int k_rows_archived = 120;
constexpr UtcTime k_down{k_noon.ns + 600'000'000'000}, k_filed{k_noon.ns + 86'400'000'000'000};
const std::function<bool()> k_copy_on = [] { return true; };

Range row_with_cir(const MissionId& mission, int i, int of = 0) {
  Range range = range_at(mission, i);
  range.cir.emplace();
  for (int k = 0; k < 100; ++k)
    range.cir->re_im.push_back(
        static_cast<std::int16_t>((i * 7919 + of * 13 + k * k * 31) % 65'536 - 32'768));
  return range;
}

void flip_a_byte(const fs::path& file) {
  std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
  const auto at = static_cast<std::streamoff>(fs::file_size(file) / 2);
  bytes.seekg(at);
  const int was = bytes.get();
  bytes.seekp(at);
  bytes.put(static_cast<char>(was ^ 0x40));
}

std::vector<std::string> names_in(const fs::path& dir, const std::string& extension = ".db") {
  std::vector<std::string> out;
  if (!fs::exists(dir)) return out;
  for (const auto& entry : fs::directory_iterator(dir))
    if (entry.path().extension() == extension) out.push_back(entry.path().filename().string());
  std::ranges::sort(out);
  return out;
}

/// What is read of a flight; nothing where its file is missing.
std::optional<std::vector<std::int16_t>> samples(Database& db, const MissionId& mission) {
  MeasurementStore::Filter filter;
  filter.mission = mission;
  filter.with_cir = true;
  filter.limit = 100'000;
  const auto page = db.stores().measurements.ranges(filter);
  if (!page) return std::nullopt;
  std::vector<std::int16_t> out;
  for (const auto& range : page.value().rows)
    if (range.cir) out.insert(out.end(), range.cir->re_im.begin(), range.cir->re_im.end());
  return out;
}

class BackupCirs : public testing::Test {
 protected:
  void SetUp() override { db_ = open_sqlite(data()); }
  fs::path data() const { return dir_.path() / "data"; }
  fs::path live() const { return data() / "cir-archive"; }
  fs::path copies() const { return dir_.path() / "copies"; }
  fs::path kept() const { return copies() / "cir-archive"; }
  fs::path at(const std::string& name) const { return copies() / name; }

  MissionId archived(Database& db) {
    Mission mission;
    mission.id = MissionId{make_uuid_v7(k_noon)};
    mission.name = "flight";
    mission.created = k_noon;
    EXPECT_TRUE(db.stores().missions.insert(mission));
    add(db, mission.id, 0, k_rows_archived);
    EXPECT_TRUE(db.stores().missions.finish(mission.id, k_down));
    archive(db, mission.id);
    return mission.id;
  }
  static void add(Database& db, const MissionId& mission, int from, int until, int of = 0) {
    std::vector<Range> rows;
    for (int i = from; i < until; ++i) rows.push_back(row_with_cir(mission, i, of));
    EXPECT_TRUE(db.stores().measurements.append_ranges(std::move(rows), false));
  }
  static void archive(Database& db, const MissionId& mission) {
    const auto moved = db.cir_archive().archive(mission, k_filed, k_copy_on);
    ASSERT_TRUE(moved) << moved.error().message;
  }
  BackupReport backed_up(const std::string& name) {
    fs::create_directories(copies());
    auto made = db_->backup(at(name));
    EXPECT_TRUE(made) << made.error().message;
    return made ? std::move(made).value() : BackupReport{};
  }
  std::unique_ptr<Database> restored(const std::string& name, const std::string& folder) {
    const auto done = restore_backup(dir_.path() / folder, at(name));
    EXPECT_TRUE(done) << done.error().message;
    return done ? open_sqlite(dir_.path() / folder) : nullptr;
  }

  ScratchDir dir_;
  std::unique_ptr<Database> db_;
};

TEST_F(BackupCirs, AreInTheBackupThatNeedsThemAndComeBackWithIt) {
  const auto mission = archived(*db_);
  const auto expected = samples(*db_, mission);
  const auto made = backed_up("one.db");
  EXPECT_EQ(made.cirs.files, 1u);
  EXPECT_EQ(made.cirs.bytes, fs::file_size(live() / (to_string(mission) + "-1.db")));
  EXPECT_THAT(made.cirs.missing, IsEmpty());
  std::ifstream list(at("one.db.sha256"));
  std::string digest, name, cir_digest, cir_name;
  list >> digest >> name >> cir_digest >> cir_name;
  EXPECT_EQ(name, "one.db");
  EXPECT_EQ(cir_name, "cir-archive/" + to_string(mission) + "-1.db");
  EXPECT_EQ(cir_digest, sql::sha256_of_file(copies() / cir_name).value()) << "as sha256sum -c compares it";
  EXPECT_EQ(check_backup_cirs(at("one.db")).value().files, 1u);
  db_.reset();
  fs::remove_all(data());
  const auto there = restored("one.db", "another");
  EXPECT_EQ(samples(*there, mission), expected);
}

TEST_F(BackupCirs, OfAForgedNameStayInTheirFolder) {
  const auto mission = archived(*db_);
  const auto expected = samples(*db_, mission);
  backed_up("one.db");
  fs::remove(at("one.db.sha256"));
  {
    sql::SqliteConnection forged(at("one.db"), sql::SqliteConnection::Mode::create, Synchronous::full,
                                 std::nullopt);
    forged.execute("UPDATE cir_archive SET file = '../../outside.db'");
  }
  const auto there = restored("one.db", "another");
  EXPECT_FALSE(fs::exists(dir_.path() / "outside.db"));
  EXPECT_THAT(names_in(dir_.path() / "another" / "cir-archive"), SizeIs(1));
  EXPECT_EQ(samples(*there, mission), expected);
}

TEST_F(BackupCirs, ServeAllBackupsBesideThem) {
  archived(*db_);
  backed_up("one.db");
  const auto file = kept() / names_in(kept()).front();
  const auto written = fs::last_write_time(file);
  archived(*db_);
  EXPECT_EQ(backed_up("two.db").cirs.files, 2u);
  EXPECT_EQ(fs::last_write_time(file), written) << "copied again";
  EXPECT_EQ(listed_backup_cirs(at("one.db")).files, 1u);
  EXPECT_EQ(listed_backup_cirs(at("two.db")).files, 2u);
}

TEST_F(BackupCirs, AreReportedWhereTheyAreMissingAndTheBackupIsNotRestoredInSilence) {
  const auto mission = archived(*db_), other = archived(*db_);
  fs::remove(live() / (to_string(mission) + "-1.db"));
  const auto made = backed_up("one.db");
  EXPECT_EQ(made.cirs.files, 1u);
  ASSERT_THAT(made.cirs.missing, SizeIs(1));
  EXPECT_THAT(made.cirs.missing[0], HasSubstr(to_string(mission)));
  EXPECT_THAT(listed_backup_cirs(at("one.db")).missing, SizeIs(1));
  EXPECT_THAT(check_backup_cirs(at("one.db")).value().missing, SizeIs(1));

  const auto there = dir_.path() / "another";
  const auto refused = restore_backup(there, at("one.db"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::unsupported);
  EXPECT_THAT(refused.error().message, HasSubstr("--without-cir-archive"));
  EXPECT_FALSE(fs::exists(there / "anchord.db"));
  EXPECT_THAT(names_in(there / "cir-archive"), IsEmpty());
  const auto done = restore_backup(there, at("one.db"), true);
  ASSERT_TRUE(done);
  EXPECT_THAT(done.value().cirs.missing, SizeIs(1));
  const auto db = open_sqlite(there);
  EXPECT_FALSE(samples(*db, mission));
  EXPECT_TRUE(samples(*db, other));
}

TEST_F(BackupCirs, AreNotTakenWhereAByteDiffers) {
  const auto mission = archived(*db_);
  flip_a_byte(live() / (to_string(mission) + "-1.db"));
  EXPECT_THAT(backed_up("damaged.db").cirs.missing, ElementsAre(HasSubstr("SHA-256 differs")));
  flip_a_byte(live() / (to_string(mission) + "-1.db"));
  EXPECT_THAT(backed_up("good.db").cirs.missing, IsEmpty());
  EXPECT_EQ(listed_backup_cirs(at("damaged.db")).missing.size(), 0u) << "the file that it needs is there now";
  flip_a_byte(kept() / (to_string(mission) + "-1.db"));
  EXPECT_THAT(check_backup_cirs(at("good.db")).value().missing, SizeIs(1));
  EXPECT_FALSE(restore_backup(dir_.path() / "another", at("good.db")));
  // The folder's own file is as good as the copy.
  db_.reset();
  EXPECT_TRUE(restore_backup(data(), at("good.db")));
}

TEST_F(BackupCirs, AreThereAlsoWhereTheFlightIsRemovedWhileTheBackupIsMade) {
  const auto mission = archived(*db_);
  const auto expected = samples(*db_, mission);
  bool removed = false;
  fs::create_directories(copies());
  const auto made = db_->backup(at("one.db"), [&] {
    if (!std::exchange(removed, true)) {
      EXPECT_TRUE(db_->stores().bin.put(mission, k_filed, 0, "me"));
      EXPECT_TRUE(db_->stores().bin.empty(mission));
      while (db_->stores().bin.remove_rows(1000).value() > 0) {
      }
      EXPECT_THAT(names_in(live()), SizeIs(1)) << "kept until the backup has it";
    }
    return true;
  });
  ASSERT_TRUE(made) << made.error().message;
  EXPECT_TRUE(removed);
  EXPECT_THAT(names_in(live()), IsEmpty());
  EXPECT_THAT(made.value().cirs.missing, IsEmpty());
  if (made.value().cirs.files == 1) {  // else the copy is of after the removal
    EXPECT_EQ(samples(*restored("one.db", "another"), mission), expected);
  }
}

TEST_F(BackupCirs, OfOneNameAndDifferentContentAreBothKept) {
  const auto mission = archived(*db_);
  backed_up("one.db");
  add(*db_, mission, k_rows_archived, k_rows_archived + 10);
  archive(*db_, mission);
  const auto first = samples(*db_, mission);
  backed_up("two.db");
  // Another folder goes on from the first backup, with other rows.
  db_ = restored("one.db", "another");
  add(*db_, mission, k_rows_archived, k_rows_archived + 10, 1);
  archive(*db_, mission);
  const auto second = samples(*db_, mission);
  ASSERT_NE(first, second);
  EXPECT_THAT(backed_up("three.db").cirs.missing, IsEmpty());
  const std::string id = to_string(mission);
  EXPECT_THAT(names_in(kept()), ElementsAre(id + "-1.db", id + "-2.db", id + "-3.db"));
  EXPECT_EQ(samples(*restored("two.db", "back to two"), mission), first);
  EXPECT_EQ(samples(*restored("three.db", "back to three"), mission), second);
}

TEST_F(BackupCirs, GoWhenNoBackupNeedsThem) {
  const auto mission = archived(*db_), other = archived(*db_);
  backed_up("one.db");
  ASSERT_TRUE(db_->stores().bin.put(mission, k_filed, 0, "me"));
  ASSERT_TRUE(db_->stores().bin.empty(mission));
  while (db_->stores().bin.remove_rows(1000).value() > 0) {
  }
  backed_up("two.db");
  sql::drop_unneeded_copies(copies());
  EXPECT_THAT(names_in(kept()), SizeIs(2)) << "the first needs both";
  fs::remove(at("one.db"));
  std::ofstream(at("unreadable.db")) << "no database";
  sql::drop_unneeded_copies(copies());
  EXPECT_THAT(names_in(kept()), SizeIs(2)) << "nobody knows what that one needs";
  fs::remove(at("unreadable.db"));
  sql::drop_unneeded_copies(copies());
  EXPECT_THAT(names_in(kept()), ElementsAre(to_string(other) + "-1.db"));
  EXPECT_THAT(check_backup_cirs(at("two.db")).value().missing, IsEmpty());
}

TEST_F(BackupCirs, StoppedAtAnyStepLeaveNoBackup) {
  archived(*db_);
  archived(*db_);
  fs::create_directories(copies());
  int stops = 0;
  for (int n = 0;; ++n, ++stops) {
    int left = n;
    const auto made = db_->backup(at("one.db"), [&] { return left-- > 0; });
    if (made) {
      EXPECT_EQ(made.value().cirs.files, 2u);
      break;
    }
    ASSERT_EQ(made.error().code, Errc::canceled);
    EXPECT_THAT(names_in(copies()), IsEmpty());
    EXPECT_THAT(names_in(copies(), ".part"), IsEmpty());
    EXPECT_THAT(names_in(kept(), ".part"), IsEmpty());
  }
  EXPECT_GE(stops, 3);
}

class PostgresCopyOfCirs : public BackupCirs {
 protected:
  void SetUp() override {
    if (const auto why = postgresql_missing(); !why.empty()) GTEST_SKIP() << why;
    BackupCirs::SetUp();
  }
  static std::string address(const std::string& name) {
    postgres_server().execute("CREATE DATABASE " + name);
    return postgres_server().address(name);
  }
  static std::unique_ptr<Database> open_at(const std::string& address, const fs::path& dir) {
    PostgresOptions options;
    options.address = address;
    options.data_dir = dir;
    return opened_or_told(open_postgres(options));
  }
  static bool go_on(const std::string&, std::uint64_t) { return true; }
};

TEST_F(PostgresCopyOfCirs, TakesTheFilesThereAndBack) {
  const auto mission = archived(*db_);
  const auto expected = samples(*db_, mission);
  db_.reset();
  const auto there = address("cirs_there");
  const auto beside = dir_.path() / "beside", back = dir_.path() / "back";
  const auto copied = copy_database(data().string(), there, {.to = beside}, go_on);
  ASSERT_TRUE(copied) << copied.error().message;
  EXPECT_EQ(copied.value().cirs.files, 1u);
  EXPECT_EQ(copied.value().cir_archive, beside / "cir-archive");
  EXPECT_EQ(samples(*open_at(there, beside), mission), expected);

  const auto unnamed = copy_database(there, back.string(), {}, go_on);
  ASSERT_FALSE(unnamed);
  EXPECT_THAT(unnamed.error().message, HasSubstr("--from-data-dir"));
  const auto home = copy_database(there, back.string(), {.from = beside}, go_on);
  ASSERT_TRUE(home) << home.error().message;
  EXPECT_EQ(home.value().cirs.files, 1u);
  EXPECT_EQ(samples(*open_sqlite(back), mission), expected);
}

TEST_F(PostgresCopyOfCirs, IsRefusedWithoutAFileUnlessItIsAskedFor) {
  const auto mission = archived(*db_);
  db_.reset();
  const auto file = live() / (to_string(mission) + "-1.db");
  flip_a_byte(file);
  const auto there = address("cirs_missing");
  const auto refused = copy_database(data().string(), there, {}, go_on);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::not_found);
  EXPECT_THAT(refused.error().message, HasSubstr("--without-cir-archive"));
  const auto copied = copy_database(data().string(), there, {.without_cirs = true}, go_on);
  ASSERT_TRUE(copied) << copied.error().message;
  EXPECT_THAT(copied.value().cirs.missing, SizeIs(1));
  // The folder that it came from goes on beside PostgreSQL, once the file is whole again.
  flip_a_byte(file);
  EXPECT_TRUE(samples(*open_at(there, data()), mission));
}

}  // namespace
}  // namespace anchord::cir_copies_test
