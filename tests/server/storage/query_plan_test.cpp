// Whatever the stores ask for in a request, SQLite answers by an index: the texts are those that were
// prepared.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "migrations/migration.hpp"
#include "server/storage/migrate.hpp"
#include "server/storage/sqlite_connection.hpp"
#include "server/storage/stores.hpp"
#include "tests/server/storage/store_contract.hpp"

namespace anchord::sql::query_plan_test {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// The real connection, and every text that was prepared on it.
class Recorded final : public Connection {
 public:
  explicit Recorded(Connection& inner) : inner_(inner) {}
  Statement& prepared(std::string_view sql) override {
    texts.emplace(sql);
    return inner_.prepared(sql);
  }
  void execute(const std::string& sql) override { inner_.execute(sql); }
  std::set<std::string> texts;

 private:
  Connection& inner_;
};

class RecordingGate final : public Gate {
 public:
  explicit RecordingGate(Connection& inner) : recorded(inner) {}
  std::optional<Error> write(std::size_t, const Work& work) override { return work(recorded); }
  std::optional<Error> read(const Work& work) override { return work(recorded); }
  Recorded recorded;
};

class QueryPlan : public testing::Test {
 protected:
  QueryPlan()
      : connection_(dir_.path() / "plans.db", SqliteConnection::Mode::create, Synchronous::normal,
                    std::nullopt),
        gate_(connection_) {
    EXPECT_TRUE(migrate(connection_, sqlite_migrations(), dir_.path() / "backups", k_noon));
    missions_ = make_mission_store(gate_, [] { return std::nullopt; });
    measurements_ = make_measurement_store(gate_);
    mission_.id = MissionId{make_uuid_v7(k_noon)};
    mission_.state = MissionState::finished;
    EXPECT_TRUE(missions_->insert(mission_));
    gate_.recorded.texts.clear();
  }
  std::vector<std::string> plan(const std::string& text) {
    Query query(connection_, "EXPLAIN QUERY PLAN " + text);
    std::vector<std::string> steps;
    while (query.step()) {
      query.skip(3);
      steps.push_back(query.text());
    }
    return steps;
  }
  /// Steps that look at every row of a table, or sort every row found; `small` tables may be looked at.
  std::vector<std::string> costly(const std::set<std::string>& small) {
    std::vector<std::string> found;
    for (const auto& text : gate_.recorded.texts) {
      for (const auto& step : plan(text)) {
        const bool scan = step.starts_with("SCAN ") && !small.contains(step.substr(5, step.find(' ', 5) - 5));
        if (scan || step == "USE TEMP B-TREE FOR ORDER BY") found.push_back(step + ": " + text);
      }
    }
    return found;
  }

  ScratchDir dir_;
  SqliteConnection connection_;
  RecordingGate gate_;
  std::unique_ptr<MissionStore> missions_;
  std::unique_ptr<MeasurementStore> measurements_;
  Mission mission_;
};

// Every filter of GET /ranges and GET /fixes, each alone and all together, forwards, backwards and from a
// cursor.
TEST_F(QueryPlan, FindsThePagesAndCountsOfAMissionByAnIndex) {
  using Filter = MeasurementStore::Filter;
  std::vector<Filter> filters(9);
  filters[1].since = filters[8].since = k_noon;
  filters[2].until = filters[8].until = UtcTime{k_noon.ns + 1'000'000'000};
  filters[3].anchor = filters[8].anchor = NetworkId{0x100};
  filters[4].tag = filters[8].tag = NetworkId{0x6e01};
  filters[5].limits.min_distance_m = filters[8].limits.min_distance_m = 2;
  filters[6].fix = filters[8].fix = FixClass::rtk_float;
  filters[7].fix = FixClass::none;
  filters[8].every = 10;
  for (Filter filter : filters) {
    filter.mission = mission_.id;
    for (const bool descending : {false, true}) {
      for (const char* after : {"", "1777889472345678000.1"}) {
        filter.descending = descending;
        filter.after = after;
        EXPECT_TRUE(measurements_->ranges(filter));
        EXPECT_TRUE(measurements_->fixes(filter));
      }
    }
    EXPECT_TRUE(measurements_->count_ranges(filter));
  }
  EXPECT_THAT(costly({"mission_bin"}), IsEmpty());
}

TEST_F(QueryPlan, FindsAClassOfPositionByThePositionsOfThatClass) {
  MeasurementStore::Filter filter;
  filter.mission = mission_.id;
  filter.fix = FixClass::rtk_float;
  ASSERT_TRUE(measurements_->ranges(filter));
  bool found = false;
  for (const auto& text : gate_.recorded.texts) {
    if (text.find(" CROSS JOIN uwb_range ") == std::string::npos) continue;
    const auto steps = plan(text);
    EXPECT_EQ(steps.front(), "SEARCH f USING INDEX fix_class_time (mission_key=? AND fix_class=?)");
    found = true;
  }
  EXPECT_TRUE(found);
}

TEST_F(QueryPlan, ListsMissionsWithTheirCountsWithoutALookAtMeasurements) {
  ASSERT_TRUE(missions_->missions(100, std::nullopt));
  ASSERT_TRUE(measurements_->count_ranges(mission_.id));
  ASSERT_TRUE(measurements_->count_ranges(MeasurementStore::Filter{}));
  ASSERT_TRUE(measurements_->count_fixes(mission_.id));
  ASSERT_TRUE(measurements_->devices(mission_.id));
  for (const auto& text : gate_.recorded.texts) {
    for (const char* table : {" uwb_range", " fix ", " cir "})
      EXPECT_EQ(text.find(table), std::string::npos) << text;
  }
  // The page of missions is read in the order of its table and ends at its limit.
  EXPECT_THAT(costly({"mission_bin", "mission", "device_seen"}),
              testing::Each(testing::StartsWith("USE TEMP B-TREE FOR ORDER BY: SELECT d.network_id")));
}

// Over all missions a page goes through the index of times, from where it begins.
TEST_F(QueryPlan, ReadsPagesOfAllMissionsInTheOrderOfAnIndex) {
  ASSERT_TRUE(measurements_->ranges({}));
  ASSERT_TRUE(measurements_->fixes({}));
  EXPECT_THAT(costly({"mission_bin"}),
              ElementsAre(testing::StartsWith("SCAN fix USING INDEX fix_time: "),
                          testing::StartsWith("SCAN uwb_range USING INDEX uwb_range_time: ")));
}

TEST_F(QueryPlan, ReadsOneRangeAndItsImpulseResponseByTheirKeys) {
  auto range = range_at(mission_.id, 0);
  range.cir = Cir{{1, -1, 2, -2}, 1001.6, 1.5, 1001};
  ASSERT_TRUE(measurements_->append_ranges({range}, false));
  ASSERT_THAT(measurements_->append_ranges({range}, false).value(), ElementsAre(RowOutcome::duplicate));
  ASSERT_TRUE(measurements_->append_fixes({fix_at(mission_.id, 0)}, false));
  ASSERT_THAT(measurements_->append_fixes({fix_at(mission_.id, 0)}, false).value(),
              ElementsAre(RowOutcome::duplicate));
  ASSERT_TRUE(measurements_->range(1));
  EXPECT_THAT(costly({"mission_bin"}), IsEmpty());
}

}  // namespace
}  // namespace anchord::sql::query_plan_test
