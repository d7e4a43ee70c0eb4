// A flight never waits for a disk: rows are live as they come, stored behind, and each is in the flight once,
// however often it is sent.
#include "api/stream/hub.hpp"
#include "app_fixture.hpp"
#include "core/ports/devices.hpp"
#include "tests/full_disk.hpp"

namespace anchord::test::live_first_test {
namespace {

constexpr std::int64_t k_start_us = 1'777'889'472'000'000;

/// Counts the positions that live flights tell of.
struct Positions final : api::HubListener {
  void on_message(api::Topic, const std::shared_ptr<const api::LiveMessage>& message) override {
    told += static_cast<int>(message->elements.size());
  }
  void on_tick(UtcTime, bool) override {}
  void on_bye(std::uint16_t, std::string_view) override {}
  std::atomic<int> told{0};
};

class LiveFirst : public AppFixture {
 protected:
  void TearDown() override {
    membership_ = {};
    AppFixture::TearDown();
  }
  std::string listened_mission() {
    const auto id = mission();
    listen();
    return id;
  }
  void listen() {
    membership_ = app_->hub().join(positions_);
    membership_.subscribe(api::Topic::fixes, std::nullopt);
  }
  static std::string fixes(int from, int to) {
    std::string out;
    for (int i = from; i < to; ++i) {
      out += Json{{"t_us", k_start_us + i * 250'000LL},
                  {"lon", 3.7131 + i * 1e-7},
                  {"lat", 51.0231},
                  {"h_m", 55.5},
                  {"fix", "fixed"},
                  {"seq", i}}
                 .dump() +
             '\n';
    }
    return out;
  }
  api::Response send(const std::string& mission, const std::string& rows) {
    return post("/api/v1/fixes", rows, "application/x-ndjson", {{"mission", mission}});
  }
  /// Positions that the live flight has told of since the last call.
  int live() {
    app_->hub().tick();
    return positions_.told.exchange(0);
  }
  int stored(const std::string& mission) { return json(get("/api/v1/missions/" + mission))["n_fixes"]; }
  static DeviceBatch of_device(const std::string& mission, int from, int to) {
    DeviceBatch out;
    for (int i = from; i < to; ++i) {
      Fix fix;
      fix.mission = MissionId{parse_uuid(mission).value()};
      fix.time = UtcTime::from_us(k_start_us + i * 250'000LL);
      fix.position = {51.0231, 3.7131 + i * 1e-7, 55.5};
      fix.fix = FixClass::rtk_fixed;
      fix.seq = i;
      out.fixes.push_back(fix);
    }
    return out;
  }

  Positions positions_;
  api::HubMembership membership_;
};

TEST_F(LiveFirst, RowsThatTheDiskRefusedAreLiveAtOnceAndOnceHoweverOftenTheyAreSent) {
  const auto flight = listened_mission();
  ASSERT_EQ(send(flight, fixes(0, 10)).status, 200);
  EXPECT_EQ(live(), 10);
  {
    const FullDisk full;
    EXPECT_EQ(send(flight, fixes(10, 30)).status, 507);
    EXPECT_EQ(live(), 20) << "the flight goes on by what came";
    EXPECT_EQ(send(flight, fixes(10, 30)).status, 507);
    EXPECT_EQ(live(), 0);
  }
  EXPECT_EQ(stored(flight), 10);
  const auto kept = send(flight, fixes(10, 40));
  ASSERT_EQ(kept.status, 200) << kept.body;
  EXPECT_EQ(json(kept)["accepted"], 30);
  EXPECT_EQ(live(), 10) << "what it has had does not come twice";
  EXPECT_EQ(stored(flight), 40);
  EXPECT_EQ(json(send(flight, fixes(0, 40)))["duplicates"], 40);
  EXPECT_EQ(live(), 0);
}

TEST_F(LiveFirst, RowsThatComeLateAreLiveOnceTheyAreStored) {
  const auto flight = listened_mission();
  ASSERT_EQ(send(flight, fixes(20, 30)).status, 200);
  ASSERT_EQ(send(flight, fixes(0, 20)).status, 200);
  EXPECT_EQ(live(), 30);
}

TEST_F(LiveFirst, AfterARestartWhatIsStoredIsKnownAgain) {
  const auto flight = mission();
  ASSERT_EQ(send(flight, fixes(0, 30)).status, 200);
  restart();
  listen();
  (void)get("/api/v1/anchors", {{"view", "live"}, {"mission", flight}});
  EXPECT_EQ(json(send(flight, fixes(0, 31)))["accepted"], 1);
  EXPECT_EQ(live(), 1);
}

TEST_F(LiveFirst, WhatMustBeWholeIsLiveOnlyOnceItIsStored) {
  const auto flight = listened_mission();
  const auto answer = post("/api/v1/fixes", fixes(0, 5) + R"({"t_us":7})" + "\n", "application/x-ndjson",
                           {{"mission", flight}, {"atomic", "true"}});
  EXPECT_EQ(answer.status, 422) << answer.body;
  EXPECT_EQ(live(), 0);
}

TEST_F(LiveFirst, RowsOfDevicesAreLiveBeforeTheyAreStoredAndNotAgainAfter) {
  const auto flight = listened_mission();
  const auto batch = of_device(flight, 0, 25);
  app_->device_rows().live(batch);
  EXPECT_EQ(live(), 25);
  EXPECT_EQ(stored(flight), 0);
  {
    const FullDisk full;
    EXPECT_FALSE(app_->device_rows().store(batch));
  }
  ASSERT_TRUE(app_->device_rows().store(batch));
  EXPECT_EQ(stored(flight), 25);
  EXPECT_EQ(live(), 0);
  const auto repeated = of_device(flight, 20, 30);
  app_->device_rows().live(repeated);
  ASSERT_TRUE(app_->device_rows().store(repeated));
  EXPECT_EQ(live(), 5);
}

TEST_F(LiveFirst, ARowOfTwoSendersIsLiveOnceWhoeverIsStoredFirst) {
  const auto flight = listened_mission();
  const auto batch = of_device(flight, 0, 25);
  app_->device_rows().live(batch);
  EXPECT_EQ(live(), 25);
  ASSERT_EQ(send(flight, fixes(0, 25)).status, 200);
  EXPECT_EQ(stored(flight), 25) << "the second sender was stored first";
  EXPECT_EQ(live(), 0);
  ASSERT_TRUE(app_->device_rows().store(batch));
  EXPECT_EQ(stored(flight), 25);
  EXPECT_EQ(live(), 0);
}

TEST_F(LiveFirst, RowsOfAMissionThatRecordsAreLiveAtOnceAfterARestart) {
  const auto flight = mission();
  restart();
  listen();
  app_->device_rows().live(of_device(flight, 0, 25));
  EXPECT_EQ(live(), 25);
}

TEST_F(LiveFirst, RowsOfAMissionThatIsNotFollowedAreLiveOnceTheyAreStored) {
  const auto flight = mission();
  ASSERT_EQ(post("/api/v1/missions/" + flight + "/actions", R"({"action":"finish"})").status, 200);
  restart();
  listen();
  const auto batch = of_device(flight, 0, 25);
  app_->device_rows().live(batch);
  EXPECT_EQ(live(), 0);
  ASSERT_TRUE(app_->device_rows().store(batch));
  EXPECT_EQ(live(), 25);
}

}  // namespace
}  // namespace anchord::test::live_first_test
