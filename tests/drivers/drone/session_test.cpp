// The session against the simulated autopilot, byte by byte and faster than real time. What the autopilot
// does is what was seen on ArduCopter 4.7-dev and is written of PX4.
#include "drivers/drone/session.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "drivers/sim/autopilot.hpp"

namespace anchord::drone::session_test {
namespace {

constexpr std::int64_t k_unix_us = 1'777'888'800'000'000;

class Pair {
 public:
  explicit Pair(sim::AutopilotOptions a = {}, SessionOptions s = {}) : autopilot(std::move(a)), session(s) {}

  void run(double seconds) {
    const double end = now + seconds;
    while (now < end) {
      now += 0.05;
      const auto unix_us = k_unix_us + static_cast<std::int64_t>(now * 1e6);
      autopilot.advance(now);
      session.feed(now, unix_us, autopilot.take_bytes());
      session.tick(now, unix_us);
      const auto out = session.take_bytes();
      if (!link_down) autopilot.feed(out);
      for (auto& r : session.take_reports()) reports.push_back(std::move(r));
    }
  }
  /// Nothing is heard, and nobody hears; the autopilot goes on.
  void silence(double seconds) {
    for (const double end = now + seconds; now < end;) {
      now += 0.05;
      autopilot.advance(now);
      (void)autopilot.take_bytes();
      session.tick(now, k_unix_us + static_cast<std::int64_t>(now * 1e6));
      (void)session.take_bytes();
      for (auto& r : session.take_reports()) reports.push_back(std::move(r));
    }
  }
  template <class Done>
  bool run_until(Done done, double seconds) {
    for (const double end = now + seconds; now < end;) {
      run(0.2);
      if (done()) return true;
    }
    return false;
  }
  CommandState last(std::uint64_t number) const {
    CommandState out{};
    for (const auto& r : reports) {
      if (r.number == number) out = r.state;
    }
    return out;
  }
  std::string words(std::uint64_t number) const {
    std::string out;
    for (const auto& r : reports) {
      if (r.number == number) out = r.text;
    }
    return out;
  }
  bool fly() {
    run(6);
    session.new_flight(2);
    const auto number = session.take_off(4);
    return run_until([&] { return last(number) == CommandState::accepted; }, 60) &&
           run_until([&] { return session.status().relative_m.value_or(0) > 3.8; }, 20);
  }
  std::uint64_t go(double east_m, double north_m, double up_m, std::optional<double> heading_deg) {
    // 51.0231 degrees north: 69 960 m a degree of longitude on a sphere of 6371 km.
    return session.go_to(51.0231 + north_m / 111'195,
                         3.7131 + east_m / (111'195 * std::cos(51.0231 * M_PI / 180)), up_m, heading_deg);
  }

  sim::AutopilotSim autopilot;
  Session session;
  std::vector<CommandReport> reports;
  double now{0};
  bool link_down{false};
};

class EachAutopilot : public ::testing::TestWithParam<Autopilot> {
 protected:
  sim::AutopilotOptions options() const {
    sim::AutopilotOptions o;
    o.dialect = GetParam();
    o.ready_s = 5;
    return o;
  }
};
INSTANTIATE_TEST_SUITE_P(Dialects, EachAutopilot, ::testing::Values(Autopilot::ardupilot, Autopilot::px4),
                         [](const auto& given) { return std::string(dialect_of(given.param).name); });

TEST_P(EachAutopilot, TakesOffFliesToATargetWithItsHeadingHoldsAndLands) {
  Pair pair(options());
  ASSERT_TRUE(pair.fly());
  const auto go = pair.go(10, -5, 6, 90);
  EXPECT_TRUE(pair.run_until([&] { return pair.last(go) == CommandState::accepted; }, 2.1)) << pair.words(go);
  pair.run(15);
  EXPECT_NEAR(pair.autopilot.vehicle().position_m().x(), 10, 0.3);
  EXPECT_NEAR(pair.autopilot.vehicle().position_m().y(), -5, 0.3);
  EXPECT_NEAR(pair.autopilot.vehicle().position_m().z(), 6, 0.3);
  EXPECT_NEAR(*pair.session.status().heading_deg, 90, 2);
  const auto hold = pair.session.hold();
  pair.run(2.1);
  EXPECT_EQ(pair.last(hold), CommandState::accepted);
  const auto again = pair.go(0, 0, 6, std::nullopt);
  pair.run(2.1);
  EXPECT_EQ(pair.last(again), CommandState::accepted) << "after a hold it goes on: " << pair.words(again);
  const auto land = pair.session.land();
  EXPECT_TRUE(pair.run_until([&] { return !pair.session.status().armed; }, 30));
  EXPECT_EQ(pair.last(land), CommandState::accepted);
}

TEST_P(EachAutopilot, ReturnsHome) {
  Pair pair(options());
  ASSERT_TRUE(pair.fly());
  (void)pair.go(8, 8, 5, std::nullopt);
  pair.run(10);
  const auto number = pair.session.return_home();
  EXPECT_TRUE(pair.run_until([&] { return !pair.session.status().armed; }, 60));
  EXPECT_EQ(pair.last(number), CommandState::accepted);
  EXPECT_NEAR(pair.autopilot.vehicle().position_m().head<2>().norm(), 0, 0.6);
}

TEST_P(EachAutopilot, ACommandWithoutAnAnswerIsReportedWithinTwoSeconds) {
  Pair pair(options());
  ASSERT_TRUE(pair.fly());
  pair.link_down = true;
  const double begun = pair.now;
  const auto number = pair.session.hold();
  ASSERT_TRUE(pair.run_until([&] { return pair.last(number) == CommandState::unconfirmed; }, 5));
  EXPECT_LE(pair.now - begun, 2.3);
  const auto go = pair.go(5, 5, 5, std::nullopt);
  ASSERT_TRUE(pair.run_until([&] { return pair.last(go) == CommandState::unconfirmed; }, 5));
}

TEST_P(EachAutopilot, FliesOnALossyLink) {
  auto lossy = options();
  lossy.loss = 0.2;
  lossy.duplicate = 0.1;
  Pair pair(lossy);
  ASSERT_TRUE(pair.fly());
  (void)pair.go(6, 0, 5, 180);
  pair.run(12);
  EXPECT_NEAR(pair.autopilot.vehicle().position_m().x(), 6, 0.3);
  EXPECT_GT(pair.session.counters().lost, 10u);
}

TEST_P(EachAutopilot, UploadsAndDownloadsMissionAndFence) {
  Pair pair(options());
  pair.run(3);
  std::vector<MissionItem> items;
  for (int i = 0; i < 7; ++i)
    items.push_back({i == 0 ? 22 : 16, 6, 4, 0, 0, 90, 510231000 + i, 37131000 - i, 5.0 + i});
  for (const auto list : {ItemList::mission, ItemList::fence}) {
    const auto up = pair.session.upload(list, items);
    ASSERT_TRUE(pair.run_until([&] { return pair.last(up) == CommandState::accepted; }, 10))
        << pair.words(up);
    const auto down = pair.session.download(list);
    ASSERT_TRUE(pair.run_until([&] { return pair.last(down) == CommandState::accepted; }, 10))
        << pair.words(down);
    EXPECT_EQ(pair.session.downloaded(), items);
    items.pop_back();
  }
}

const GeoPolygon k_fence{{3.712, 51.022}, {3.715, 51.022}, {3.715, 51.025}, {3.712, 51.025}},
    k_pond{{3.713, 51.0235}, {3.7132, 51.0235}, {3.7131, 51.0236}};

TEST_P(EachAutopilot, KeepsTheFenceAndTheRouteItWasGiven) {
  auto lossy = options();
  lossy.loss = 0.2;
  lossy.duplicate = 0.1;
  Pair pair(lossy);
  pair.run(3);
  const auto fence = pair.session.upload_fence({k_fence, {k_pond}});
  ASSERT_TRUE(pair.run_until([&] { return pair.last(fence) == CommandState::accepted; }, 60))
      << pair.words(fence);
  EXPECT_EQ(pair.words(fence), "7 items, read back");
  ASSERT_EQ(pair.autopilot.fence_list().size(), 7u);
  // MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION and _EXCLUSION, with the number of corners in param1.
  EXPECT_EQ(pair.autopilot.fence_list()[0].integer("command"), 5001);
  EXPECT_EQ(pair.autopilot.fence_list()[0].real("param1"), 4);
  EXPECT_EQ(pair.autopilot.fence_list()[0].integer("x"), 510220000);
  EXPECT_EQ(pair.autopilot.fence_list()[6].integer("command"), 5002);
  EXPECT_EQ(pair.autopilot.fence_list()[6].real("param1"), 3);
  const auto route =
      pair.session.upload_route({{{3.7130, 51.0230}, 4, 45, 3}, {{3.7135, 51.0230}, 9, {}, 0}});
  ASSERT_TRUE(pair.run_until([&] { return pair.last(route) == CommandState::accepted; }, 60))
      << pair.words(route);
  // ArduPilot's item 0 is home.
  const std::size_t first = GetParam() == Autopilot::ardupilot ? 1 : 0;
  ASSERT_EQ(pair.autopilot.mission_list().size(), first + 2);
  const auto& point = pair.autopilot.mission_list()[first];
  EXPECT_EQ(point.integer("command"), 16);
  EXPECT_EQ(point.integer("frame"), 6) << "above home";
  EXPECT_EQ(point.integer("y"), 37130000);
  EXPECT_EQ(point.real("z"), 4);
  EXPECT_EQ(point.real("param4"), 45);
}

TEST_P(EachAutopilot, SendsAListOnceTheTransferBeforeItHasEndedAndOfOneListTheNewestAlone) {
  Pair pair(options());
  pair.run(3);
  const auto route =
      pair.session.upload_route({{{3.7130, 51.0230}, 4, 45, 3}, {{3.7135, 51.0230}, 9, {}, 0}});
  const auto first = pair.session.upload_fence({k_fence, {}}),
             fence = pair.session.upload_fence({k_fence, {k_pond}});
  EXPECT_EQ(pair.last(fence), CommandState::sent);
  ASSERT_TRUE(pair.run_until([&] { return pair.last(fence) == CommandState::accepted; }, 60))
      << pair.words(fence);
  EXPECT_EQ(pair.last(route), CommandState::accepted) << pair.words(route);
  EXPECT_EQ(pair.last(first), CommandState::unconfirmed);
  EXPECT_EQ(pair.words(first), "followed by another upload of the fence");
  EXPECT_EQ(pair.autopilot.fence_list().size(), 7u);
}

TEST(DroneSession, AnAutopilotWithoutFencesSaysSo) {
  sim::AutopilotOptions old;
  old.keeps_fences = false;
  Pair pair(old);
  pair.run(3);
  const auto number = pair.session.upload_fence({k_fence, {}});
  ASSERT_TRUE(pair.run_until([&] { return pair.last(number) == CommandState::refused; }, 10));
  EXPECT_NE(pair.words(number).find("does not support"), std::string::npos) << pair.words(number);
}

TEST(DroneSession, AListThatAnotherGroundStationReplacesIsNoLongerConfirmed) {
  Pair pair;
  pair.run(3);
  const auto number = pair.session.upload_fence({k_fence, {}});
  ASSERT_TRUE(pair.run_until([&] { return pair.last(number) == CommandState::accepted; }, 20));
  mavlink::Packer autopilot{{1, 1}};
  const auto tell = [&](int system, int type, int list) {
    const auto ack = mavlink::Message("MISSION_ACK")
                         .set("target_system", system)
                         .set("target_component", 190)
                         .set("type", type)
                         .set("mission_type", list);
    pair.session.feed(pair.now, k_unix_us, autopilot.pack(ack));
    pair.run(0.1);
  };
  tell(254, 14, 1);
  EXPECT_EQ(pair.last(number), CommandState::accepted) << "it was denied";
  tell(254, 0, 0);
  EXPECT_EQ(pair.last(number), CommandState::accepted) << "a mission, not the fence";
  tell(254, 0, 1);
  EXPECT_EQ(pair.last(number), CommandState::unconfirmed);
  EXPECT_EQ(pair.words(number),
            "another ground station (system 254) has replaced the fence in the autopilot since");
}

TEST_P(EachAutopilot, AfterARestartOrALongSilenceOnTheGroundTheFenceIsNotKnownToBeThere) {
  for (const bool restart : {true, false}) {
    Pair pair(options());
    pair.run(6);
    const auto number = pair.session.upload_fence({k_fence, {}});
    ASSERT_TRUE(pair.run_until([&] { return pair.last(number) == CommandState::accepted; }, 20));
    if (restart) {
      ASSERT_TRUE(pair.autopilot.restart());
      pair.run(12);
    } else {
      pair.silence(14);
      pair.run(1.5);
    }
    EXPECT_EQ(pair.last(number), CommandState::unconfirmed) << restart;
    EXPECT_NE(pair.words(number).find(restart ? "restarted since" : "may be another one"), std::string::npos)
        << pair.words(number);
  }
}

TEST(DroneSession, AnAutopilotThatAsksForOneItemForEverEndsTheTransfer) {
  Pair pair;
  pair.run(3);
  pair.link_down = true;  // what is heard from here on is written by hand
  const auto number = pair.session.upload_fence({k_fence, {}});
  mavlink::Packer autopilot{{1, 1}};
  for (int i = 0; i < 40 && pair.last(number) == CommandState::sent; ++i) {
    pair.session.feed(pair.now, k_unix_us,
                      autopilot.pack(mavlink::Message("MISSION_REQUEST_INT")
                                         .set("target_system", 255)
                                         .set("seq", 1)
                                         .set("mission_type", 1)));
    pair.run(0.5);
  }
  EXPECT_EQ(pair.last(number), CommandState::unconfirmed);
  EXPECT_EQ(pair.words(number).rfind("the autopilot asks for item 1 again and again", 0), 0U)
      << pair.words(number);
}

TEST(DroneSession, AListWithoutAnAnswerIsNotConfirmed) {
  Pair pair;
  pair.run(3);
  pair.link_down = true;
  const auto number = pair.session.upload_fence({k_fence, {}});
  EXPECT_TRUE(pair.run_until([&] { return pair.last(number) == CommandState::unconfirmed; }, 10));
  Session deaf;
  EXPECT_EQ((deaf.upload_fence({k_fence, {}}), deaf.take_reports().back().state), CommandState::refused)
      << "nobody was heard yet";
}

TEST_P(EachAutopilot, ARefusalToArmIsReportedWithinTwoSecondsInItsWordsAndIsTheEndOfIt) {
  Pair pair(options());
  pair.run(6);
  pair.autopilot.refuse_arming("Throttle too high");
  pair.run(1.5);
  EXPECT_EQ(pair.session.status().ready_to_arm, false);
  EXPECT_NE(pair.session.status().not_ready.find("Throttle too high"), std::string::npos);
  pair.session.new_flight(2);
  const auto number = pair.session.take_off(4);
  ASSERT_TRUE(pair.run_until([&] { return pair.last(number) == CommandState::refused; }, 2));
  EXPECT_NE(pair.words(number).find("Throttle too high"), std::string::npos) << pair.words(number);
  pair.autopilot.refuse_arming("");
  pair.run(20);
  EXPECT_FALSE(pair.autopilot.vehicle().armed()) << "it was armed 7 s later, when the throttle was lowered";
}

TEST_P(EachAutopilot, TextsOfAnEarlierRefusalDoNotExplainTodays) {
  Pair pair(options());
  pair.autopilot.refuse_arming("Gyros inconsistent");
  pair.run(8);
  pair.autopilot.refuse_arming("");
  pair.run(2);
  EXPECT_EQ(pair.session.status().ready_to_arm, true);
  EXPECT_EQ(pair.session.status().not_ready, "");
  pair.session.new_flight(2);
  pair.link_down = true;
  const auto number = pair.session.take_off(4);
  pair.run(4);
  EXPECT_EQ(pair.last(number), CommandState::unconfirmed);
  EXPECT_EQ(pair.words(number).find("Gyros"), std::string::npos) << pair.words(number);
}

TEST(DroneSession, WhenThePilotTakesOverNoTargetIsSentAnyMore) {
  sim::AutopilotOptions o;
  o.ready_s = 5;
  Pair pair(o);
  ASSERT_TRUE(pair.fly());
  (void)pair.go(20, 0, 5, std::nullopt);
  pair.run(5);
  pair.autopilot.pilot_takes_over(5);  // LOITER
  pair.run(2);
  EXPECT_TRUE(pair.session.status().taken_over);
  const auto where = pair.autopilot.vehicle().position_m();
  pair.run(5);
  EXPECT_LT((pair.autopilot.vehicle().position_m() - where).norm(), 1.0) << "the mode is not switched back";
  EXPECT_EQ(pair.autopilot.custom_mode(), 5u);
  const auto refused = pair.go(5, 5, 5, std::nullopt);
  pair.run(0.1);
  EXPECT_EQ(pair.last(refused), CommandState::refused);
}

TEST(DroneSession, RefusesTargetsThatAreNoPlace) {
  sim::AutopilotOptions o;
  o.ready_s = 5;
  Pair pair(o);
  ASSERT_TRUE(pair.fly());
  for (const auto& [lat, lon, up] :
       {std::tuple{std::nan(""), 3.7, 5.0}, {0.0, 0.0, 5.0}, {51.0231, 3.72, 5.0}, {91.0, 3.7, 5.0}}) {
    const auto number = pair.session.go_to(lat, lon, up, std::nullopt);
    pair.run(0.1);
    EXPECT_EQ(pair.last(number), CommandState::refused);
  }
}

TEST(DroneSession, TellsWhenTheVehicleFallsSilent) {
  Pair pair;
  EXPECT_FALSE(pair.session.status().connected);
  pair.run(2);
  EXPECT_TRUE(pair.session.status().connected);
  EXPECT_EQ(pair.session.status().autopilot, "ArduPilot");
  pair.autopilot.set_silent(true);
  pair.run(4.5);
  EXPECT_FALSE(pair.session.status().connected);
  EXPECT_GT(pair.session.status().silent_s, 3);
}

TEST(DroneSession, WithoutTheStationsHeartbeatTheSimulatedAutopilotReturns) {
  sim::AutopilotOptions o;
  o.ready_s = 5;
  Pair pair(o);
  ASSERT_TRUE(pair.fly());
  (void)pair.go(10, 0, 5, std::nullopt);
  pair.run(8);
  pair.link_down = true;
  pair.run(8);
  EXPECT_TRUE(pair.autopilot.failsafe());
  EXPECT_EQ(pair.session.status().mode, "RTL");
}

TEST(DroneSession, SignedLinksRefuseUnsignedStations) {
  mavlink::Secret secret{};
  secret.fill(7);
  sim::AutopilotOptions o;
  o.ready_s = 5;
  o.secret = secret;
  SessionOptions with;
  with.secret = secret;
  Pair good(o, with);
  EXPECT_TRUE(good.fly());
  Pair bad(o);
  bad.run(10);
  bad.session.new_flight(2);
  const auto number = bad.session.take_off(4);
  bad.run(10);
  EXPECT_FALSE(bad.autopilot.vehicle().armed());
  EXPECT_NE(bad.last(number), CommandState::accepted);
}

}  // namespace

void PrintTo(CommandState state, std::ostream* out) { *out << static_cast<int>(state); }

}  // namespace anchord::drone::session_test
