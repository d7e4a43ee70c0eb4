// What an autopilot says is not yet so: acknowledged and not done, a position that is none, two that answer
// as one.
#include <limits>

#include "conditions.hpp"

namespace anchord::test::link_truth_test {
namespace {

using mavlink::Message;

class LinkTruth : public Conditions {
 protected:
  std::string stays() const {
    return "accepted, but it stays in " + std::string(drone::mode_word(GetParam(), dialect().guided));
  }
};
INSTANTIATE_TEST_SUITE_P(Dialects, LinkTruth, ::testing::Values(Autopilot::ardupilot, Autopilot::px4),
                         [](const auto& given) { return std::string(drone::dialect_of(given.param).name); });

// Acknowledged is not done.

TEST_P(LinkTruth, WhatIsAcknowledgedAndNotDoneIsUnconfirmedAndNobodysTakeOver) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  rig.autopilot.options().does_nothing = true;
  ASSERT_EQ(rig.act("land"), "");
  ASSERT_TRUE(rig.run_until([&] { return rig.fate("land") != CommandState::sent; }, 2.2));
  EXPECT_EQ(rig.fate("land"), CommandState::unconfirmed);
  EXPECT_EQ(rig.words("land"), stays());
  rig.run(15);
  EXPECT_EQ(rig.fate("land"), CommandState::unconfirmed);
  EXPECT_FALSE(rig.control->taken_over()) << rig.reason();
  for (const auto& e : rig.events) EXPECT_NE(e.code, "drone.taken_over") << e.text;
  rig.autopilot.options().does_nothing = false;
  ASSERT_EQ(rig.act("land"), "");
  rig.run(2);
  EXPECT_EQ(rig.fate("land"), CommandState::accepted);
  EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 60)) << rig.reason();
}

TEST_P(LinkTruth, TwoCommandsInARowThatAreNotDoneAreNobodysTakeOver) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  rig.autopilot.options().does_nothing = true;
  rig.act("return");
  rig.run(0.3);
  rig.act("land");
  rig.run(15);
  EXPECT_EQ(rig.words("land"), stays());
  EXPECT_FALSE(rig.control->taken_over()) << rig.reason();
}

TEST_P(LinkTruth, AModeThatComesLateIsAcceptedThenAndIsNobodysTakeOver) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  rig.autopilot.options().mode_lag_s = 4;
  rig.autopilot.vehicle().set_speed(0.1);
  rig.act("land");
  rig.run(3);
  EXPECT_EQ(rig.fate("land"), CommandState::unconfirmed);
  rig.run(3);
  EXPECT_EQ(rig.fate("land"), CommandState::accepted);
  EXPECT_EQ(rig.words("land"), "late");
  EXPECT_FALSE(rig.run_until([&] { return rig.control->taken_over(); }, 15)) << rig.reason();
}

TEST_P(LinkTruth, OutsideOfAFlightAnAcknowledgementIsNoLandingEither) {
  AirRig rig(options());
  rig.run(7);
  rig.autopilot.vehicle().arm();
  rig.autopilot.vehicle().take_off(4);
  rig.run(3);
  rig.autopilot.options().does_nothing = true;
  rig.act("land");
  rig.act("disarm");
  rig.run(3);
  EXPECT_EQ(rig.fate("land"), CommandState::unconfirmed);
  EXPECT_EQ(rig.words("disarm"), "accepted, but it stays armed");
  rig.autopilot.options().does_nothing = false;
  rig.act("land");
  rig.run(2);
  EXPECT_EQ(rig.fate("land"), CommandState::accepted);
}

TEST_P(LinkTruth, AnAutopilotThatAcknowledgesAndStandsIsNotThePilots) {
  AirRig rig(options());
  rig.run(7);
  rig.autopilot.options().does_nothing = true;
  ASSERT_TRUE(rig.start());
  rig.run(5);
  EXPECT_EQ(rig.fate("take_off"), CommandState::unconfirmed);
  EXPECT_EQ(rig.words("take_off"),
            GetParam() == Autopilot::px4 ? "it does not arm" : "it does not change its mode");
  EXPECT_FALSE(rig.control->taken_over()) << rig.reason();
}

// A position that is none.

Message position(double lat_deg, double lon_deg, std::int64_t up_mm, std::int64_t heading) {
  return Message("GLOBAL_POSITION_INT")
      .set("time_boot_ms", 1000)
      .set("lat", std::llround(lat_deg * 1e7))
      .set("lon", std::llround(lon_deg * 1e7))
      .set("alt", up_mm)
      .set("relative_alt", up_mm)
      .set("hdg", heading);
}

TEST(NoPosition, APlaceThatIsNoneIsNoPosition) {
  constexpr std::int64_t k_most = std::numeric_limits<std::int32_t>::max(),
                         k_least = std::numeric_limits<std::int32_t>::min();
  for (const auto& none :
       {position(0, 0, 20'000, 0), position(91, 3.7, 20'000, 0), position(-90.1, 3.7, 0, 0),
        position(51, 180.1, 20'000, 0), position(214.7, -214.7, 20'000, 0), position(51, 3.7, k_most, 0),
        position(51, 3.7, k_least, 0)}) {
    drone::Session session;
    mavlink::Packer copter({1, 1});
    const auto say = [&](double now_s, const Message& m) {
      session.feed(now_s, AirRig::k_unix_us,
                   copter.pack(Message("HEARTBEAT").set("type", 2).set("autopilot", 3)));
      for (const char* stream : {"SYS_STATUS", "EXTENDED_SYS_STATE", "GPS_RAW_INT"})
        session.feed(now_s, AirRig::k_unix_us, copter.pack(Message(stream)));
      session.feed(now_s, AirRig::k_unix_us, copter.pack(m));
    };
    say(1, position(51.5, 3.5, 20'000, 9'000));
    for (int n = 2; n <= 8; ++n) say(n, none);
    const auto s = session.status();
    ASSERT_TRUE(s.connected && s.position);
    EXPECT_DOUBLE_EQ(s.position->lat_deg, 51.5);
    EXPECT_DOUBLE_EQ(s.position->height_m, 20);
    EXPECT_DOUBLE_EQ(s.relative_m.value_or(0), 20);
    EXPECT_DOUBLE_EQ(s.position_age_s, 7) << "of the last one that was one";
    ASSERT_EQ(s.stale.size(), 1u);
    EXPECT_EQ(s.stale.front().rfind("GLOBAL_POSITION_INT", 0), 0u) << s.stale.front();
    session.new_flight(2);
    (void)session.take_off(4);
    EXPECT_EQ(session.take_reports().back().text, "the autopilot does not report its position");
  }
}

TEST(NoPosition, AHeadingThatIsNoneIsNone) {
  for (const auto& [hdg, known] :
       {std::pair{35'999, true}, {36'000, true}, {36'001, false}, {65'535, false}}) {
    drone::Session session;
    mavlink::Packer copter({1, 1});
    session.feed(1, AirRig::k_unix_us, copter.pack(Message("HEARTBEAT").set("type", 2).set("autopilot", 3)));
    session.feed(1, AirRig::k_unix_us, copter.pack(position(51, 3.7, 0, 9'000)));
    session.feed(1, AirRig::k_unix_us, copter.pack(position(51, 3.7, 0, hdg)));
    EXPECT_EQ(session.status().heading_deg.has_value(), known) << hdg;
  }
}

TEST_P(LinkTruth, AnAutopilotThatLosesItsPlaceInFlightHoldsUntilItHasOne) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  const auto alarmed = [&] {
    return rig.control->engine().alarm() && rig.control->engine().alarm()->id == "position.disagree";
  };
  rig.autopilot.options().no_place = true;
  EXPECT_TRUE(rig.run_until(alarmed, 6));
  const auto shift = rig.control->shift_m();
  for (int i = 0; i < 20; ++i) {
    rig.run(0.5);
    EXPECT_TRUE(alarmed()) << "after " << i << " halves of a second";
  }
  EXPECT_EQ(rig.step_now(), Step::hold) << rig.reason();
  EXPECT_EQ(rig.control->shift_m(), shift) << "what it does not know is no drift of its barometer";
  rig.autopilot.options().no_place = false;
  EXPECT_TRUE(rig.run_until([&] { return !alarmed(); }, 3));
}

// Two that answer as one.

/// The other one: on the ground 800 m away, switched on an hour ago.
class Twin {
 public:
  void speak(AirRig& rig) {
    const auto hear = [&](const Message& m) {
      rig.session->feed(rig.now, AirRig::k_unix_us, packer_.pack(m));
    };
    hear(Message("HEARTBEAT")
             .set("type", 2)
             .set("autopilot", rig.autopilot.options().dialect == Autopilot::px4 ? 12 : 3)
             .set("base_mode", 0x51));
    hear(Message("EXTENDED_SYS_STATE").set("landed_state", 1));
    hear(position(51.03, 3.72, 30'000, 0).set("time_boot_ms", 3'600'000 + std::llround(rig.now * 1000)));
  }

 private:
  mavlink::Packer packer_{{1, 1}};
};

TEST_P(LinkTruth, TwoAutopilotsWithOneIdAreNamedBeforeTheFlight) {
  AirRig rig(options());
  Twin twin;
  rig.run(7);
  EXPECT_EQ(rig.session->status().link_trouble, "");
  for (int i = 0; i < 20; ++i) {
    twin.speak(rig);
    rig.run(0.2);
  }
  const auto why = rig.session->status().link_trouble;
  EXPECT_EQ(why.rfind("two autopilots answer as system 1", 0), 0u) << why;
  rig.session->new_flight(2);
  (void)rig.session->take_off(4);
  rig.run(0.2);
  EXPECT_EQ(rig.fate("take_off"), CommandState::refused);
  EXPECT_EQ(rig.words("take_off"), why);
  rig.run(10);
  EXPECT_EQ(rig.session->status().link_trouble, "") << "the other was switched off";
}

TEST_P(LinkTruth, TwoAutopilotsWithOneIdAreNoPilotInFlight) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  Twin twin;
  for (int i = 0; i < 20; ++i) {
    twin.speak(rig);
    rig.run(0.2);
  }
  EXPECT_TRUE(rig.control->taken_over()) << "nothing is commanded to two at once";
  EXPECT_NE(rig.reason().find("two autopilots answer as system 1"), std::string::npos) << rig.reason();
  EXPECT_EQ(rig.reason().find("pilot or a failsafe"), std::string::npos) << rig.reason();
}

TEST_P(LinkTruth, AnAutopilotOnTheGroundDoesNotEndTheFlightOfItsTwinInTheAir) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  Twin twin;
  // So often that every round of the procedure sees what the other one says.
  for (int i = 0; i < 240; ++i) {
    twin.speak(rig);
    rig.step();
    ASSERT_FALSE(rig.done()) << rig.reason();
  }
  EXPECT_EQ(rig.step_now(), Step::hold);
  rig.run(12);  // the other one is switched off
  EXPECT_EQ(rig.session->status().link_trouble, "");
  EXPECT_EQ(rig.act("land"), "");
  EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 60)) << rig.reason();
}

TEST_P(LinkTruth, ARestartIsNoSecondAutopilot) {
  AirRig rig(options());
  rig.run(20);
  ASSERT_TRUE(rig.autopilot.restart());
  for (int i = 0; i < 100; ++i) {
    rig.run(0.2);
    EXPECT_EQ(rig.session->status().link_trouble, "");
  }
}

}  // namespace
}  // namespace anchord::test::link_truth_test
