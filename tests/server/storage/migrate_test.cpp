#include "server/storage/migrate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <sstream>
#include <thread>

#include "core/ports/access_store.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"
#include "tests/paths.hpp"
#include "tests/server/storage/child.hpp"
#include "tests/server/storage/store_contract.hpp"

namespace anchord::sql::migrate_test {
namespace {

using Mode = SqliteConnection::Mode;

SqliteConnection connect(const std::filesystem::path& file, Mode mode = Mode::create) {
  return {file, mode, Synchronous::full, std::nullopt};
}

class Migrate : public testing::Test {
 protected:
  std::filesystem::path file() const { return dir_.path() / "m.db"; }
  Result<void> run(SqliteConnection& c, std::span<const Migration> migrations) {
    return migrate(c, migrations, dir_.path() / "backups", k_noon);
  }
  static std::int64_t count(SqliteConnection& c, const char* text) {
    Query query(c, text);
    return query.step() ? query.integer() : -1;
  }
  ScratchDir dir_;
};

// A landed migration is never edited. When this fails, the file was: take the edit back and write a new one.
TEST_F(Migrate, FindsEveryLandedMigrationAsItWas) {
  std::string digests;
  for (const Migration& m : sqlite_migrations())
    digests += std::to_string(m.number) + " " + sha256_hex(m.sql) + "\n";
  EXPECT_EQ(digests,
            "1 5b9e60fa88e5313cd602de900b5ef1fd26ec48251481d3a023274024847ee06c\n"
            "2 ad11b0eed4c5aff882920b5fcc638e5259e0c6473959d36e0761e034016131e5\n"
            "3 9cc8bb069b7b00cc826ce0963d78aa7083e5eb65208fa55d54c1986363e232dd\n"
            "4 b61b44684821815843481b6e9fdc70b291983fb47986fc58515f0ff89c06d2ce\n"
            "5 f6fddabd2c8bebecb1b9370fa20c1a691b2facf7483f685b5be0583a65374ef3\n"
            "6 fa850be7202896aa8b044cc8cab22219a207f27ab439030bb69bc0bbc91eae96\n"
            "7 928ced75f17f95eee611eef5bcb10890a421087a2d744c12b04838d2bc94e8cc\n"
            "8 993f088a1a82f736ed536f4af9fbb963034237ed191e6e299a8e5d4a46bceb2f\n"
            "9 7c4ffeb6bd9e4aeb1810a60170fbca4d00fb10c4e5046f130dc0dc47fbdbec15\n"
            "10 098b135dddac37d59e25a60e4ca32042085fe09793cd02a168a2db795eed8968\n"
            "11 fb46c23aed9b18c6fb8d78f4b993f62c7c9955ea2d2f7ce173a314072fd736a2\n"
            "12 772f473e05d3ce7c38825e4939476ca713a0069c8b4555c9abcce6f130781942\n"
            "13 845d3d59444816e9878b0455545bdeeba14f292f9fcd6ca1591df6771568df0c\n"
            "14 07550435216e8f5b8dde3ec2b19bcbc653d17024461c3afb34ea1d91a477033b\n"
            "15 c4d0c3098b96c7b66b1bcd1603afcbaf7bd527a53a085cbc772bf58472a4a1a6\n"
            "16 6c1d5f68e7d310e7397bff93064ab2eea45da27703ed075ce627ae502304aafe\n"
            "17 5abe94cc37df54a1682fdefdb3c80df458b0b9ae705057063c74231d15138763\n"
            "18 a321ed30ffc793ad0a3abe4a581d763e81c93057111c1585840c155e1043395a\n"
            "19 0f74240deb1acbb9558d993f5299545713624b395c4c161950a6738675df3792\n"
            "20 1352e742a624fea1d90bef0c901052fca5fb74416b1de59078c4ec154e47d45b\n"
            "21 84c4b4519ba854471f06258236d51fe2308c585274418d8b00ee6d5fcd97d85f\n"
            "22 3f353be0ec3276795a2b41bdf12553b667b26e63b4b7c4972e07032bb0211cb2\n"
            "23 6454ed717093a8f18de1950f6279cdb7371cbd5231d42d4b3ec364d97592f255\n"
            "24 dd1416ca2fbf3db40b8c7f6366e2cedcf1a790ca18755680e1ed7695887820b4\n");
}

TEST_F(Migrate, KnowsTheDigestOfAPublishedVector) {
  // FIPS 180-2, appendix B.1
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

// The first one stands for whatever a version 1 was; the second takes long enough to be caught in the middle.
const std::vector<Migration>& two_steps() {
  static const std::string slow = [] {
    const std::string numbers =
        "WITH RECURSIVE n (value) AS (SELECT 1 UNION ALL SELECT value + 1 FROM n LIMIT 60000) SELECT value "
        "FROM n";
    return "CREATE TABLE b (x INTEGER) STRICT; INSERT INTO b " + numbers + "; DROP TABLE a; ";
  }();
  static const std::vector<Migration> steps = {{1, "first",
                                                "CREATE TABLE schema_migration (number INTEGER PRIMARY KEY, "
                                                "name TEXT NOT NULL, sha256_hex TEXT NOT NULL, "
                                                "applied_t_ns INTEGER NOT NULL) STRICT; CREATE TABLE a (x "
                                                "INTEGER) STRICT; INSERT INTO a VALUES (42);"},
                                               {2, "second", slow}};
  return steps;
}

TEST_F(Migrate, MakesACopyBeforeItTouchesADatabaseThatHasSomething) {
  auto c = connect(file());
  ASSERT_TRUE(run(c, std::span(two_steps()).first(1)));
  EXPECT_FALSE(std::filesystem::exists(dir_.path() / "backups"));
  ASSERT_TRUE(run(c, two_steps()));
  EXPECT_EQ(c.pragma("user_version"), 2);
  auto copy = connect(dir_.path() / "backups" / "before-migration-2.db", Mode::read_only);
  EXPECT_EQ(copy.pragma("user_version"), 1);
  EXPECT_EQ(count(copy, "SELECT x FROM a"), 42);
}

TEST_F(Migrate, RefusesADatabaseWhoseStepsWereOthers) {
  auto c = connect(file());
  ASSERT_TRUE(run(c, std::span(two_steps()).first(1)));
  std::vector<Migration> edited = two_steps();
  edited[0].sql = "CREATE TABLE other (x INTEGER) STRICT;";
  const auto result = run(c, edited);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::unsupported);
  EXPECT_EQ(c.pragma("user_version"), 1);
}

TEST_F(Migrate, LeavesTheOldVersionWhenAStepFails) {
  auto c = connect(file());
  ASSERT_TRUE(run(c, std::span(two_steps()).first(1)));
  std::vector<Migration> broken = two_steps();
  broken[1].sql = "CREATE TABLE b (x INTEGER) STRICT; INSERT INTO nowhere VALUES (1);";
  EXPECT_THROW(static_cast<void>(run(c, broken)), SqlError);
  EXPECT_EQ(c.pragma("user_version"), 1);
  EXPECT_EQ(count(c, "SELECT count(*) FROM sqlite_schema WHERE name = 'b'"), 0);
}

TEST_F(Migrate, IsAtTheOldOrTheNewVersionAfterAKillAtAnyInstant) {
  std::mt19937 random(3);
  int old_version = 0;
  for (int round = 0; round < 20; ++round) {
    std::filesystem::remove_all(dir_.path() / "backups");
    for (const char* end : {"", "-wal", "-shm"}) std::filesystem::remove(file().string() + end);
    {
      auto c = connect(file());
      ASSERT_TRUE(run(c, std::span(two_steps()).first(1)));
    }
    Child child([&](int out) {
      auto c = connect(file(), Mode::read_write);
      if (::write(out, "x", 1) != 1) return 1;
      return run(c, two_steps()) ? 0 : 1;
    });
    child.read_byte();
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 40'000));  // the random instant itself
    child.kill_now();
    auto c = connect(file(), Mode::read_write);
    EXPECT_EQ(c.check(true), "ok");
    const auto version = c.pragma("user_version");
    ASSERT_TRUE(version == 1 || version == 2) << version;
    old_version += version == 1 ? 1 : 0;
    EXPECT_EQ(count(c, "SELECT count(*) FROM schema_migration"), version);
    EXPECT_EQ(count(c, "SELECT count(*) FROM sqlite_schema WHERE name = 'a'"), version == 1 ? 1 : 0);
    EXPECT_EQ(count(c, "SELECT count(*) FROM sqlite_schema WHERE name = 'b'"), version == 1 ? 0 : 1);
    ASSERT_TRUE(run(c, two_steps())) << "the next start finishes it";
    EXPECT_EQ(count(c, "SELECT count(*) FROM b"), 60000);
  }
  EXPECT_GT(old_version, 0) << "no kill came in time: make the step slower";
}

TEST_F(Migrate, StartsAgainAfterAKillDuringTheVeryFirstStart) {
  std::mt19937 random(5);
  for (int round = 0; round < 20; ++round) {
    StorageOptions options;
    options.data_dir = dir_.path() / ("first" + std::to_string(round));
    options.reserve_bytes = 0;
    {
      Child child([&](int out) {
        if (::write(out, "x", 1) != 1) return 1;
        return open_database(options) ? 0 : 1;
      });
      child.read_byte();
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 60'000));
    }
    const auto db = open_database(options);
    ASSERT_TRUE(db) << db.error().message;
    EXPECT_TRUE(db.value()->stores().missions.missions(1, std::nullopt));
  }
}

TEST_F(Migrate, OpensAStoredDatabaseOfEveryEarlierVersion) {
  for (int version = 1; version <= newest_schema_version(); ++version) {
    std::ifstream in(std::filesystem::path(ANCHORD_TEST_DATA) / "storage" /
                     ("version_" + std::to_string(version) + ".sql"));
    std::stringstream text;
    text << in.rdbuf();
    ASSERT_FALSE(text.str().empty()) << "store a database of version " << version
                                     << " (see migrations/README.md)";
    StorageOptions options;
    options.data_dir = dir_.path() / ("v" + std::to_string(version));
    options.reserve_bytes = 0;
    std::filesystem::create_directories(options.data_dir);
    connect(options.data_dir / "anchord.db").execute(text.str());
    const auto db = open_database(options);
    ASSERT_TRUE(db) << db.error().message;
    const auto missions = db.value()->stores().missions.missions(10, std::nullopt).value();
    ASSERT_EQ(missions.size(), 1u);
    EXPECT_EQ(missions[0].name, "stored flight");
    EXPECT_EQ(missions[0].lever_arm_sigma_m, version < 14 ? std::nullopt : std::optional(0.02));
    EXPECT_EQ(db.value()->stores().measurements.count_ranges(missions[0].id).value(), 3u);
    EXPECT_EQ(db.value()->stores().measurements.count_fixes(missions[0].id).value(), 2u);
    MeasurementStore::Filter filter;
    filter.with_cir = true;
    EXPECT_TRUE(db.value()->stores().measurements.ranges(filter).value().rows[0].cir);
    EXPECT_EQ(db.value()->stores().measurements.fixes({}).value().rows.size(), 2u);
    EXPECT_EQ(db.value()->stores().revisions.published(std::nullopt).value().size(), 1u);
    EXPECT_TRUE(db.value()->stores().access.verify_audit());
  }
}

// Writes the stored database of the newest version: run with ANCHORD_WRITE_STORED=DIR, then dump it as
// migrations/README.md says.
TEST_F(Migrate, WritesAStoredDatabaseWhenAsked) {
  const char* dir = std::getenv("ANCHORD_WRITE_STORED");
  if (dir == nullptr) return;
  StorageOptions options;
  options.data_dir = dir;
  options.reserve_bytes = 0;
  const auto db = open_database(options).value();
  Mission m;
  m.id = MissionId{make_uuid_v7(k_noon)};
  m.name = "stored flight";
  m.tags = {{NetworkId{0x6e01}, 0, {0.1, 0, -0.12}}};
  m.lever_arm_sigma_m = 0.02;
  ASSERT_TRUE(db->stores().missions.insert(m));
  std::vector<Range> ranges = {range_at(m.id, 0), range_at(m.id, 1), range_at(m.id, 2)};
  ranges[0].cir = Cir{{1, -1, 2, -2}, 1001.6, 1.5, 1001};
  ASSERT_TRUE(db->stores().measurements.append_ranges(ranges, true));
  ASSERT_TRUE(db->stores().measurements.append_fixes({fix_at(m.id, 0), fix_at(m.id, 1)}, true));
  ASSERT_TRUE(db->stores().anchors.find_or_create(NetworkId{0x100}, k_noon));
  Calibration c;
  c.id = CalibrationId{make_uuid_v7(k_noon)};
  c.missions = {m.id};
  c.anchors.emplace_back();
  c.anchors[0].anchor = NetworkId{0x100};
  c.anchors[0].best = Hypothesis{};
  ASSERT_TRUE(db->stores().calibrations.insert(c));
  ASSERT_TRUE(db->stores().revisions.publish(c.id, {NetworkId{0x100}}, "token", "note", k_noon));
  ASSERT_TRUE(db->stores().access.append_audit({k_noon, "token", "publish", "127.0.0.1", "ok"}));
}

}  // namespace
}  // namespace anchord::sql::migrate_test
