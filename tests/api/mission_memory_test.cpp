// Which missions are in memory: those in the air, and few others, however many are read.
#include "core/ports/devices.hpp"
#include "mission_fixture.hpp"

namespace anchord::test::mission_memory_test {
namespace {

constexpr int k_most_at_rest = 4;  // docs/operations.md

class MissionMemory : public MissionLive {
 protected:
  int followed() {
    const std::string text = get("/metrics").body, name = "\nanchord_live_missions ";
    const auto at = text.find(name);
    EXPECT_NE(at, std::string::npos) << text;
    return at == std::string::npos ? -1 : std::stoi(text.substr(at + name.size()));
  }
  void finish(const std::string& id) {
    const auto answer = post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})");
    ASSERT_EQ(answer.status, 200) << answer.body;
  }
  /// What a reader goes by; positions are compared apart, for they were solved by another path.
  static Json counts(const std::map<std::string, Json>& anchors) {
    Json out;
    for (const auto& [id, p] : anchors)
      out[id] = {{"used", p["quality"]["n_ranges"]}, {"rejected", p["quality"]["n_refused"]}};
    return out;
  }
  static Eigen::Vector3d place(const Json& properties) {
    const auto at = properties["local_m"].get<std::vector<double>>();
    return {at.at(0), at.at(1), at.at(2)};
  }
};

TEST_F(MissionMemory, TwoHundredFinishedMissionsLeaveFewInMemoryAndReadTheSameWhenTheyAreBack) {
  const auto flight = streamed(MadeFlight{});
  std::vector<std::pair<std::string, Json>> flown;
  for (int i = 0; i < 200; ++i) {
    const auto id = mission("local");
    deliver(id, flight, 0, 3.2);
    finish(id);
    flown.emplace_back(id, counts(live(id)));
    EXPECT_EQ(flown.back().second.size(), 4U);
    EXPECT_LE(followed(), k_most_at_rest + 1);
  }
  for (const auto& [id, before] : flown) {
    EXPECT_EQ(counts(live(id)), before) << id;
    EXPECT_LE(followed(), k_most_at_rest + 1) << "until the next tick the last one";
  }
  const std::string left = "\nanchord_live_missions_evicted_total " + std::to_string(200 - followed()) + '\n';
  EXPECT_NE(get("/metrics").body.find(left), std::string::npos) << left << get("/metrics").body;
}

TEST_F(MissionMemory, AFlightThatIsBackFromTheStoreStandsWhereItStood) {
  const MadeFlight made;
  const auto flight = streamed(made);
  const auto id = mission("local");
  deliver(id, flight, 0, 60);
  finish(id);
  const auto before = live(id);
  for (int i = 0; i < k_most_at_rest; ++i) finish(mission("local"));
  // By a reader, who leaves it out of memory, and by rows that come late, which bring it back.
  for (const double until_s : {60.0, 90.0}) {
    deliver(id, flight, 60, until_s);
    const auto after = live(id);
    ASSERT_EQ(after.size(), before.size());
    for (const auto& [anchor, properties] : after) {
      const int n_before = before.at(anchor)["quality"]["n_ranges"], n = properties["quality"]["n_ranges"];
      if (until_s > 60)
        EXPECT_GT(n, n_before);
      else
        EXPECT_NEAR(n, n_before, 2) << "the lag of a joint solution moves rows at the ends of the track";
      EXPECT_LT((place(properties) - place(before.at(anchor))).norm(), 0.15) << anchor;
      const auto& truth = made.anchors.at(std::stoul(anchor, nullptr, 16) - 0x6000);
      EXPECT_LT((place(properties) - truth).norm(), 0.3) << anchor;
    }
  }
}

TEST_F(MissionMemory, AMissionInTheAirStaysHoweverManyOthersAreFlown) {
  const auto flight = streamed(MadeFlight{});
  const auto in_air = mission("local");
  deliver(in_air, flight, 0, 3);
  for (int i = 0; i < 20; ++i) finish(mission("local"));
  EXPECT_EQ(followed(), k_most_at_rest + 2) << "the one in the air, and until the next tick the last one";
  const auto n = [&] { return live(in_air).at("0x6000")["quality"]["n_ranges"].get<int>(); };
  const int before = n();
  // Of a device, before the store has them: only who is in memory can have them.
  DeviceBatch batch;
  const auto of = [&](auto row) {
    row.mission = MissionId{parse_uuid(in_air).value()};
    row.time = UtcTime::from_us(k_start_us + row.time.us());
    return row;
  };
  for (const auto& fix : flight.fixes) {
    if (fix.time.seconds() >= 3 && fix.time.seconds() < 6) batch.fixes.push_back(of(fix));
  }
  for (const auto& range : flight.ranges) {
    if (range.time.seconds() >= 3 && range.time.seconds() < 6) batch.ranges.push_back(of(range));
  }
  app_->device_rows().live(batch);
  EXPECT_GT(n(), before);
}

TEST_F(MissionMemory, AReaderFollowsNothingAndStoresNothing) {
  const auto flight = streamed(MadeFlight{});
  const auto id = mission("local");
  deliver(id, flight, 0, 3.2);
  finish(id);
  const auto before = counts(live(id));
  restart();
  EXPECT_EQ(followed(), 0);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(counts(live(id)), before);
  EXPECT_EQ(json(get("/api/v1/anchors/0x6001/estimates", {{"mission", id}}))["items"].size(), 1U);
  EXPECT_EQ(get("/api/v1/anchors", {{"view", "live"}}).status, 200);
  EXPECT_EQ(followed(), 0);
}

/// What recorded when the server was restarted is followed again by itself: its next rows wait for no store.
TEST_F(MissionMemory, AMissionThatRecordsIsFollowedAgainAfterARestart) {
  const auto flight = streamed(MadeFlight{});
  const auto id = mission("local");
  deliver(id, flight, 0, 3.2);
  restart();
  EXPECT_EQ(followed(), 1);
  EXPECT_EQ(live(id).size(), 4U);
}

}  // namespace
}  // namespace anchord::test::mission_memory_test
