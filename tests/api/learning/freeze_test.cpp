// A data set made of a flight that goes away meanwhile, over a real database.
#include <chrono>
#include <thread>

#include "core/ports/learning_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/mission_store.hpp"
#include "tests/api/app_fixture.hpp"

namespace anchord::test::freeze_test {
namespace {

/// A hundred a second to one anchor, all alike.
std::vector<Range> ranges_of(const Mission& mission, int n) {
  std::vector<Range> ranges(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) {
    auto& range = ranges[static_cast<std::size_t>(i)];
    range.mission = mission.id;
    range.time = UtcTime{1'700'000'000'000'000'000 + i * 10'000'000LL};
    range.tag = NetworkId{0x6e01};
    range.anchor = NetworkId{0x6a21};
    range.distance_m = 5;
  }
  return ranges;
}

using Freeze = AppFixture;

TEST_F(Freeze, AFlightDeletedWhileItIsFrozenIsFrozenWholeOrNotAtAll) {
  constexpr int k_rows = 6000;  // six pages
  int whole = 0, refused = 0;
  for (int round = 0; round < 12; ++round) {
    Mission mission;
    mission.id.uuid = make_uuid_v7(clock_.now());
    mission.name = "labelled " + std::to_string(round);
    mission.created = clock_.now();
    mission.state = MissionState::finished;
    ASSERT_TRUE(database_->stores().missions.insert(mission).has_value());
    ASSERT_TRUE(database_->stores().measurements.append_ranges(ranges_of(mission, k_rows), true).has_value());
    RangeTruth truth;
    truth.distance_m = 4.9;
    truth.los = true;
    ASSERT_EQ(database_->stores().labels.label({mission.id, {}, {}, {}, {}}, truth).value(), k_rows);
    // A little later in each round: before, in the middle of and after the reading.
    std::thread purge([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(3 * round));
      ASSERT_TRUE(database_->stores().bin.put(mission.id, clock_.now(), 0, "me").has_value());
      ASSERT_TRUE(database_->stores().bin.empty(mission.id).has_value());
      while (database_->stores().bin.remove_rows(1000).value() > 0) {
      }
    });
    const auto made =
        post("/api/v1/datasets", R"({"name":"flight )" + std::to_string(round) + R"(","missions":[")" +
                                     to_string(mission.id) + R"("],"aggregation":"none"})");
    purge.join();
    if (made.status == 201) {
      ++whole;
      EXPECT_EQ(json(made).value("train", 0) + json(made).value("test", 0), k_rows) << made.body;
    } else {
      ++refused;
      EXPECT_EQ(made.status, 422) << made.body;
    }
  }
  RecordProperty("whole", whole);
  RecordProperty("refused", refused);
}

TEST_F(Freeze, TwoFlightsOfOneNameAreTwoPlaces) {
  std::string missions;
  for (const bool los : {true, false}) {
    Mission mission;
    mission.id.uuid = make_uuid_v7(clock_.now());
    mission.name = "calibration";
    mission.created = clock_.now();
    mission.state = MissionState::finished;
    ASSERT_TRUE(database_->stores().missions.insert(mission).has_value());
    ASSERT_TRUE(database_->stores().measurements.append_ranges(ranges_of(mission, 20), true).has_value());
    RangeTruth truth;
    truth.distance_m = 4.9;
    truth.los = los;
    ASSERT_EQ(database_->stores().labels.label({mission.id, {}, {}, {}, {}}, truth).value(), 20);
    missions += (missions.empty() ? "\"" : ",\"") + to_string(mission.id) + '"';
  }
  const auto made = post("/api/v1/datasets", R"({"name":"both","missions":[)" + missions +
                                                 R"(],"aggregation":"none","split":{"test_share":0.5}})");
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["train"], 20);
  EXPECT_EQ(json(made)["test"], 20);
}

}  // namespace
}  // namespace anchord::test::freeze_test
