// Backups: made on schedule and on request, few kept, put back.
#include <fstream>

#include "core/ports/mission_store.hpp"
#include "server/runtime/backup_keeper.hpp"
#include "server/storage/sqlite_database.hpp"
#include "tests/scratch_dir.hpp"
#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::backup_test {
namespace {

const std::function<bool()> k_on = [] { return true; };
constexpr double k_300_days_h = 300 * 24;

struct HandSteady final : SteadyClock {
  SteadyTime now() const override { return time; }
  SteadyTime time{5'000'000'000};
};
struct HandClock final : Clock {
  UtcTime now() const override { return time; }
  UtcTime time{1'777'889'472'000'000'000};
  HandSteady steady;
  void pass_h(double hours) {
    step_h(hours);
    steady.time.ns += static_cast<std::int64_t>(hours * 3.6e12);
  }
  /// Somebody sets it; no time passes.
  void step_h(double hours) { time.ns += static_cast<std::int64_t>(hours * 3.6e12); }
};

class BackupFiles : public ::testing::Test {
 protected:
  void SetUp() override { open(); }
  void open() {
    StorageOptions options;
    options.data_dir = data();
    options.reserve_bytes = 0;
    auto opened = open_database(options);
    ASSERT_TRUE(opened) << opened.error().message;
    database_ = std::move(opened).value();
  }
  std::filesystem::path data() const { return dir_.path() / "data"; }
  std::filesystem::path copies() const { return dir_.path() / "copies"; }
  server::BackupKeeper keeper(std::size_t keep = 7) {
    return server::BackupKeeper(*database_, clock_, {copies(), keep, 24, true, &clock_.steady});
  }
  MissionId mission(const std::string& name) {
    Mission mission;
    mission.id.uuid = make_uuid_v7(clock_.now());
    mission.name = name;
    mission.created = clock_.now();
    EXPECT_TRUE(database_->stores().missions.insert(mission));
    return mission.id;
  }
  ScratchDir dir_;
  HandClock clock_;
  std::unique_ptr<Database> database_;
};

TEST_F(BackupFiles, KeepsTheNewestAndNothingOfOthers) {
  auto backups = keeper();
  std::filesystem::create_directories(copies());
  std::ofstream(copies() / "before-migration-2.db") << "not ours to delete";
  for (int i = 0; i < 9; ++i) {
    clock_.pass_h(1);
    ASSERT_TRUE(backups.make(k_on));
  }
  const auto kept = backups.list();
  ASSERT_EQ(kept.size(), 7u);
  EXPECT_EQ(kept[0].made, clock_.time) << "newest first";
  EXPECT_EQ(kept[0].sequence, 9u);
  EXPECT_EQ(kept[0].sha256_hex.size(), 64u);
  EXPECT_EQ(kept[0].bytes, std::filesystem::file_size(copies() / kept[0].name));
  EXPECT_TRUE(std::filesystem::exists(copies() / "before-migration-2.db"));
}

// A clock that ran ahead while seven were made: from then on each new one was the oldest by name, and went.
TEST_F(BackupFiles, KeepsEachNewOneAfterTheClockRanAhead) {
  auto backups = keeper();
  clock_.step_h(k_300_days_h);
  for (int i = 0; i < 7; ++i) ASSERT_TRUE(backups.make(k_on));
  clock_.step_h(-k_300_days_h);
  for (int i = 0; i < 3; ++i) {
    const auto made = backups.make(k_on);
    ASSERT_TRUE(made);
    EXPECT_TRUE(std::filesystem::exists(copies() / made.value().name));
    EXPECT_EQ(backups.list().front().name, made.value().name);
  }
  EXPECT_EQ(backups.list().size(), 7u);
  EXPECT_EQ(keeper().list().front().sequence, 10u) << "also for the next process";
}

TEST_F(BackupFiles, NumbersGoOnAfterFilesOfBeforeThereWereNumbers) {
  std::filesystem::create_directories(copies());
  std::ofstream(copies() / "anchord-2030-01-01T00-00-00.000000Z.db")
      << "of an older anchord, its clock ahead";
  const auto made = keeper().make(k_on);
  ASSERT_TRUE(made);
  EXPECT_EQ(made.value().sequence, 1u);
  const auto all = keeper().list();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[0].name, made.value().name);
}

TEST_F(BackupFiles, NeverFallBelowSevenGoodOnesAndABadOneCountsForNothing) {
  auto backups = keeper(1);
  for (int i = 0; i < 7; ++i) ASSERT_TRUE(backups.make(k_on));
  ASSERT_EQ(backups.list().size(), 7u) << "asked for one, kept seven";
  const auto spoil = [&](const std::string& name) {
    std::fstream file(copies() / name, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(9000);
    file.put('?');
    clock_.pass_h(25);  // what was found good is read again
  };
  const auto all = backups.list();
  spoil(all[1].name);
  std::filesystem::remove(copies() / (all[2].name + ".sha256"));
  ASSERT_TRUE(backups.make(k_on));
  ASSERT_TRUE(backups.make(k_on));
  EXPECT_EQ(backups.list().size(), 9u) << "seven good ones among nine: nothing may go";
  ASSERT_TRUE(backups.make(k_on));
  const auto left = backups.list();
  ASSERT_EQ(left.size(), 9u) << "the oldest good one went";
  EXPECT_EQ(std::ranges::count(left, std::optional(false), &Backup::good), 2);
  EXPECT_EQ(std::ranges::count(left, std::optional(true), &Backup::good), 7);
}

TEST_F(BackupFiles, AreDueByTheSteadyClockWhateverTheSystemClockSays) {
  auto backups = keeper();
  EXPECT_FALSE(backups.due(0));
  clock_.step_h(k_300_days_h);
  EXPECT_FALSE(backups.due(0)) << "a step ahead is no day that passed";
  ASSERT_TRUE(backups.make(k_on));
  clock_.step_h(-2 * k_300_days_h);
  clock_.pass_h(23);
  EXPECT_FALSE(backups.due(0));
  clock_.pass_h(1.1);
  EXPECT_TRUE(backups.due(0)) << "a step back holds none up";
  auto next_start = keeper();
  EXPECT_TRUE(next_start.due(0)) << "the newest seems to be of the future: better one more";
}

TEST_F(BackupFiles, AreDueEachDayAndAfterEveryFlightButNotAllTheTime) {
  auto backups = keeper();
  EXPECT_FALSE(backups.due(0)) << "nothing to lose yet";
  clock_.pass_h(24.1);
  EXPECT_TRUE(backups.due(0));
  EXPECT_FALSE(backups.due(0)) << "just begun";
  ASSERT_TRUE(backups.make(k_on));
  clock_.pass_h(23);
  EXPECT_FALSE(backups.due(0));
  clock_.pass_h(0.01);
  EXPECT_TRUE(backups.due(1)) << "a flight ended";
  clock_.pass_h(0.01);
  EXPECT_FALSE(backups.due(2)) << "another, half a minute later";
  clock_.pass_h(0.2);
  EXPECT_TRUE(backups.due(2));
  server::BackupKeeper off(*database_, clock_, {copies(), 7, 24, false, &clock_.steady});
  clock_.pass_h(100);
  EXPECT_FALSE(off.due(9));
}

TEST_F(BackupFiles, TellWhenTheNewestWasMadeAndWhyTheLastAttemptFailed) {
  auto backups = keeper();
  EXPECT_FALSE(backups.state().newest);
  ASSERT_TRUE(backups.make(k_on));
  const UtcTime first = clock_.now();
  clock_.pass_h(30);
  // A file where the folder was: no backup can be written there, as on a disk that is gone.
  const auto aside = dir_.path() / "aside";
  std::filesystem::rename(copies(), aside);
  std::ofstream(copies()) << "not a folder";
  const auto refused = backups.make(k_on);
  ASSERT_FALSE(refused);
  EXPECT_EQ(backups.state().failure, refused.error().message);
  EXPECT_EQ(backups.state().newest, first);
  std::filesystem::remove(copies());
  std::filesystem::rename(aside, copies());
  ASSERT_TRUE(backups.make(k_on));
  EXPECT_EQ(backups.state().failure, "");
  EXPECT_EQ(backups.state().newest, clock_.now());
  EXPECT_EQ(keeper().state().newest, clock_.now()) << "a server that starts again looks into the folder";
}

TEST_F(BackupFiles, ArePutBackWithWhatStoodThereKept) {
  const auto before = mission("in the backup");
  const auto made = keeper().make(k_on);
  ASSERT_TRUE(made) << made.error().message;
  clock_.pass_h(1);
  const auto after = mission("made later");
  const auto copy = copies() / made.value().name;
  EXPECT_EQ(restore_backup(data(), copy).error().code, Errc::conflict) << "the folder is in use";
  database_.reset();
  const auto old = restore_backup(data(), copy);
  ASSERT_TRUE(old) << old.error().message;
  open();
  EXPECT_TRUE(database_->stores().missions.mission(before));
  EXPECT_EQ(database_->stores().missions.mission(after).error().code, Errc::not_found);
  // And back again: nothing was lost by it.
  database_.reset();
  ASSERT_TRUE(old.value().old);
  ASSERT_TRUE(restore_backup(data(), *old.value().old));
  open();
  EXPECT_TRUE(database_->stores().missions.mission(after));
}

TEST_F(BackupFiles, AreRefusedWhenTheyAreNotWhatWasBackedUp) {
  mission("kept");
  const auto made = keeper().make(k_on);
  ASSERT_TRUE(made);
  database_.reset();
  const auto copy = copies() / made.value().name;
  const auto error_of = [&](const std::filesystem::path& file) {
    return restore_backup(data(), file).error().code;
  };
  EXPECT_EQ(error_of(dir_.path() / "nowhere.db"), Errc::not_found);
  EXPECT_EQ(restore_backup(dir_.path() / "new" / "data", dir_.path() / "nowhere.db").error().code,
            Errc::not_found);
  EXPECT_FALSE(std::filesystem::exists(dir_.path() / "new")) << "a wrong name makes no folder";
  std::ofstream(dir_.path() / "text.db") << std::string(100'000, 'x');
  EXPECT_EQ(error_of(dir_.path() / "text.db"), Errc::unsupported);
  {
    std::fstream file(copy, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(9000);
    file.put('?');
  }
  EXPECT_EQ(error_of(copy), Errc::unsupported) << "one byte differs";
  open();
  EXPECT_EQ(database_->stores().missions.missions(10, std::nullopt).value().size(), 1u)
      << "untouched by all of it";
}

TEST(BackupOverHttp, IsMadeByAdminsOnlyAndListed) {
  AppFixture server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto viewer = server.bearer(server.token(R"(["viewer","operator","engineer"])"));
  EXPECT_EQ(server.call("POST", "/api/v1/backups", {}, viewer).status, 403);
  auto admin = server.bearer(server.admin);
  admin["Prefer"] = "wait=60";
  const auto made = server.call("POST", "/api/v1/backups", {}, admin);
  ASSERT_EQ(made.status, 201) << made.body;
  const auto list = server.call("GET", "/api/v1/backups", {}, admin);
  EXPECT_NE(list.body.find(made.body), std::string::npos) << list.body;
}

}  // namespace
}  // namespace anchord::test::backup_test
