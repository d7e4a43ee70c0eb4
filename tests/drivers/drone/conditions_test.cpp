// What happened to real flights, in ArduPilot's and in PX4's dialect: the real session and procedure against
// the simulated autopilot, faster than real time.
#include "conditions.hpp"

namespace anchord::test::conditions_test {
namespace {

INSTANTIATE_TEST_SUITE_P(Dialects, Conditions, ::testing::Values(Autopilot::ardupilot, Autopilot::px4),
                         [](const auto& given) { return std::string(drone::dialect_of(given.param).name); });

// A flight inherits nothing.

TEST_P(Conditions, AFlightAfterATakeOverFliesAndLandsAtAnEmptyBattery) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly()) << rig.reason();
  rig.autopilot.pilot_lands();
  ASSERT_TRUE(rig.run_until([&] { return rig.done(); }, 60)) << rig.reason();
  rig.autopilot.vehicle().set_battery(0.9);
  rig.run(3);
  ASSERT_TRUE(rig.start());
  ASSERT_TRUE(rig.until_step(Step::go_to_waypoint, 60)) << rig.reason();
  rig.autopilot.vehicle().set_battery(0.02);
  EXPECT_TRUE(rig.until_step(Step::landing, 5)) << rig.reason();
  EXPECT_TRUE(rig.run_until([&] { return rig.done() && !rig.autopilot.vehicle().armed(); }, 60));
}

// 100 m up at 1.5 m/s: longer than the step's time. It was told to take off again, refused that, as
// autopilots do in the air, and hovered there with a flight that had ended.
TEST_P(Conditions, ATakeOffThatClimbsForLongIsFlownAndNotLeftInTheAir) {
  AirRig rig(options());
  rig.other = [](procedure::FlightSetup& s) {
    s.settings.min_height_m = 100;
    s.settings.max_height_m = 110;
    s.limits.bounds.min_height_m = 100;
    s.limits.bounds.max_height_m = 110;
    for (auto& w : s.settings.waypoints) w.point_m.z() += 100;
  };
  rig.run(7);
  ASSERT_TRUE(rig.start());
  ASSERT_TRUE(rig.until_step(Step::go_to_waypoint, 100)) << rig.reason();
  EXPECT_GT(rig.autopilot.vehicle().position_m().z(), 85);
  rig.act("land");
  EXPECT_TRUE(rig.run_until([&] { return rig.done() && !rig.autopilot.vehicle().armed(); }, 200))
      << rig.reason();
}

// Its report came when the next flight was there already, and ended that.
TEST_P(Conditions, WhatBecameOfTheLastTakeOffIsNotTheNextFlights) {
  AirRig rig(options());
  rig.run(7);
  ASSERT_TRUE(rig.start());
  rig.act("abort");
  ASSERT_TRUE(rig.start());
  EXPECT_TRUE(rig.until_step(Step::go_to_waypoint, 60)) << rig.reason();
}

TEST_P(Conditions, WhatWaitedWhileThePilotFlewIsNeverSent) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(2);
  rig.autopilot.pilot_takes_over(pilots());
  rig.run(20);
  const double at = rig.now;
  rig.act("land");
  rig.run(3);
  for (const auto& w : rig.since(at - 1)) {
    EXPECT_EQ(w.command, 176) << kinds(rig.since(at - 1));
    EXPECT_EQ(w.mode, dialect().land);
  }
  EXPECT_FALSE(rig.since(at - 1).empty());
}

TEST_P(Conditions, WhenNothingFliesNothingIsSent) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(5);
  rig.act("land");
  ASSERT_TRUE(rig.run_until([&] { return rig.done(); }, 60));
  rig.run(3);
  const double at = rig.now;
  rig.run(60);
  EXPECT_EQ(kinds(rig.since(at)), "") << "the old target came once a second";
}

// Never arm what is not being flown.

TEST_P(Conditions, ARefusalToArmEndsTheFlightInItsWordsAndNothingArmsLater) {
  AirRig rig(options());
  rig.run(7);
  rig.autopilot.refuse_arming("Throttle too high");
  rig.run(1.5);
  ASSERT_TRUE(rig.start());
  ASSERT_TRUE(rig.run_until([&] { return rig.done(); }, 2.0)) << rig.reason();
  EXPECT_NE(rig.reason().find("Throttle too high"), std::string::npos) << rig.reason();
  EXPECT_NE(rig.act("return"), "");
  rig.autopilot.refuse_arming("");
  rig.run(20);
  EXPECT_FALSE(rig.autopilot.vehicle().armed());
}

TEST_P(Conditions, ReturnHoldAndAbortCancelATakeOffThatWaits) {
  for (const char* action : {"return", "hold", "land", "abort", "skip"}) {
    auto o = options();
    o.loss_in = 1;
    AirRig rig(o);
    rig.autopilot.options().loss_in = 0;
    rig.run(7);
    rig.autopilot.options().loss_in = 1;  // nothing arrives, the telemetry does
    ASSERT_TRUE(rig.start());
    rig.run(0.3);
    EXPECT_EQ(rig.act(action), "") << action;
    rig.run(3);
    rig.autopilot.options().loss_in = 0;
    rig.run(20);
    EXPECT_FALSE(rig.autopilot.vehicle().armed()) << action;
    EXPECT_FALSE(rig.autopilot.vehicle().in_air()) << action;
  }
}

TEST_P(Conditions, HoldAndLandAreSentWhateverTheServerBelieves) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.act("abort");
  rig.run(5);
  for (const auto& [action, mode] : {std::pair{"hold", dialect().hold}, {"land", dialect().land}}) {
    const double at = rig.now;
    EXPECT_EQ(rig.act(action), "");
    const auto sent = rig.since(at - 0.001);
    ASSERT_FALSE(sent.empty()) << action;
    EXPECT_EQ(sent.front().mode, mode);
    rig.run(3);
  }
  EXPECT_TRUE(rig.run_until([&] { return !rig.autopilot.vehicle().armed(); }, 60));
}

// Telemetry is watched.

TEST_P(Conditions, AfterABatterySwapTheStreamsAreAskedForAgain) {
  AirRig rig(options());
  rig.run(7);
  rig.autopilot.vehicle().set_battery(0.2);
  rig.run(2);
  ASSERT_NEAR(rig.session->status().battery.value_or(0), 0.2, 0.01);
  ASSERT_TRUE(rig.autopilot.restart());
  rig.autopilot.vehicle().set_battery(1.0);
  rig.run(10);
  const auto status = rig.session->status();
  EXPECT_TRUE(status.stale.empty()) << status.stale.front();
  EXPECT_NEAR(status.battery.value_or(0), 1.0, 0.01);
  EXPECT_LT(status.position_age_s, 1);
}

TEST_P(Conditions, ALostRequestForAStreamIsMadeAgainAndAStaleOneIsSaid) {
  auto o = options();
  o.loss_in = 1;
  AirRig rig(o);
  rig.run(7);
  EXPECT_FALSE(rig.session->status().stale.empty()) << "older than 5 s";
  rig.autopilot.options().loss_in = 0.3;
  rig.run(12);
  EXPECT_TRUE(rig.session->status().stale.empty());
}

// ArduPilot before 4.0 knows no SET_MESSAGE_INTERVAL but groups of messages; PX4 has none.
TEST_P(Conditions, ARefusedStreamIsShownAndAskedForByItsGroup) {
  auto o = options();
  o.old_streams = true;
  AirRig rig(o);
  rig.run(9);
  auto status = rig.session->status();
  const auto refused = [&](const std::string& name) {
    return std::count(status.streams_refused.begin(), status.streams_refused.end(), name + ": unsupported");
  };
  EXPECT_EQ(refused("EXTENDED_SYS_STATE"), 1) << "it is in no group";
  const bool groups = GetParam() == Autopilot::ardupilot;
  EXPECT_EQ(refused("GLOBAL_POSITION_INT"), groups ? 0 : 1);
  EXPECT_EQ(status.position_age_s < 1, groups);
  EXPECT_EQ(status.battery.has_value(), groups);
  EXPECT_EQ(status.gps_fix, groups ? 6 : 0);
  // After a battery swap with newer firmware it is asked for by itself again.
  rig.autopilot.options().old_streams = false;
  ASSERT_TRUE(rig.autopilot.restart());
  rig.run(20);
  status = rig.session->status();
  EXPECT_TRUE(status.streams_refused.empty()) << status.streams_refused.front();
  EXPECT_TRUE(status.stale.empty()) << status.stale.front();
}

TEST_P(Conditions, TheAutopilotsOwnBatteryWarningCounts) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.autopilot.set_battery_warning(3);  // critical, with 90 % by its count
  EXPECT_TRUE(rig.until_step(Step::landing, 5)) << rig.reason();
}

// The pilot always wins.

TEST_P(Conditions, AModeOfThePilotRightAfterACommandIsSeenAndLeft) {
  for (const char* action : {"hold", "resume", "skip"}) {
    for (const double after_s : {0.0, 0.1, 0.4, 1.0, 2.0}) {
      AirRig rig(options());
      ASSERT_TRUE(rig.fly());
      rig.run(2);
      if (std::string(action) == "resume") {
        rig.act("hold");
        rig.run(4);
      }
      rig.act(action);
      rig.run(after_s);
      rig.autopilot.pilot_takes_over(pilots());
      rig.run(2);
      const double at = rig.now;
      rig.run(20);
      EXPECT_EQ(rig.autopilot.custom_mode(), pilots()) << action << ' ' << after_s;
      EXPECT_EQ(kinds(rig.since(at)), "") << action << ' ' << after_s;
      EXPECT_TRUE(rig.control->taken_over());
    }
  }
}

TEST_P(Conditions, APilotWhoTakesOverDuringTheTakeOffKeepsIt) {
  for (const double after_s : {0.3, 0.6, 1.0, 2.0, 3.0}) {
    AirRig rig(options());
    rig.run(7);
    ASSERT_TRUE(rig.start());
    rig.run(after_s);
    if (!rig.autopilot.vehicle().in_air()) continue;
    rig.autopilot.pilot_takes_over(pilots());
    rig.run(2);
    const double at = rig.now;
    rig.run(20);
    EXPECT_EQ(rig.autopilot.custom_mode(), pilots()) << after_s;
    EXPECT_EQ(kinds(rig.since(at)), "") << after_s;
  }
}

// PX4 stands in POSCTL before it takes off: with its answers lost, the pilot who goes back to that mode while
// it climbs looked like an autopilot that has not changed its mode yet, and was told to take off once more.
TEST_P(Conditions, APilotWhoGoesBackToTheModeOfTheGroundDuringTheTakeOffIsSeen) {
  for (const double ack_loss : {0.0, 1.0}) {
    for (const double after_s : {0.5, 1.0, 1.5, 2.0, 2.5, 3.0}) {
      auto o = options();
      o.ack_loss = ack_loss;
      AirRig rig(o);
      rig.run(7);
      const auto on_the_ground = rig.autopilot.custom_mode();
      ASSERT_TRUE(rig.start());
      ASSERT_TRUE(rig.run_until([&] { return rig.autopilot.vehicle().in_air(); }, 5));
      rig.run(after_s);
      rig.autopilot.pilot_takes_over(on_the_ground);
      rig.run(6);
      const double at = rig.now;
      rig.run(70);  // a take-off is given up, or told again, after a minute
      EXPECT_EQ(rig.autopilot.custom_mode(), on_the_ground) << ack_loss << ' ' << after_s;
      EXPECT_EQ(kinds(rig.since(at)), "") << ack_loss << ' ' << after_s;
    }
  }
}

// ArduPilot's RTL and PX4's Return land in their own mode: LAND is somebody else's.
TEST_P(Conditions, AFailsafeThatLandsOnTheWayHomeIsLeftToLand) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(3);
  rig.session->return_home();
  rig.run(2);
  ASSERT_EQ(rig.autopilot.custom_mode(), dialect().return_home);
  rig.autopilot.fail(Failsafe::ekf);
  rig.run(1.5);
  EXPECT_TRUE(rig.control->taken_over());
  EXPECT_EQ(rig.autopilot.custom_mode(), dialect().land);
}

// A link that loses half is a poor one and no silence: at one heartbeat a second the failsafe (5 s) came
// within minutes.
TEST_P(Conditions, AFailsafeOfTheLinkDoesNotComeOnAPoorLink) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.act("hold");
  rig.run(3);
  rig.autopilot.options().loss_in = 0.5;
  for (int i = 0; i < 50; ++i) {
    rig.autopilot.vehicle().set_battery(0.9);
    rig.run(10);
    ASSERT_EQ(rig.autopilot.custom_mode(), dialect().hold) << "after " << 10 * i << " s";
  }
}

TEST_P(Conditions, LostHeartbeatsAreNoSilenceWhileOtherTelemetryComes) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.act("hold");
  rig.run(3);
  rig.autopilot.options().loss = 0.4;
  for (int i = 0; i < 50; ++i) {
    rig.autopilot.vehicle().set_battery(0.9);
    rig.run(10);
  }
  for (const auto& h : rig.events) EXPECT_NE(h.code, "drone.link") << h.time_s << " s: " << h.text;
}

TEST_P(Conditions, AfterASilenceOnlyAHeartbeatBringsTheLinkBack) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.link_down = true;
  rig.run(4);
  ASSERT_FALSE(rig.session->status().connected);
  mavlink::Packer other({1, 1});
  const auto position = mavlink::Message("GLOBAL_POSITION_INT").set("lat", 510231000).set("lon", 37131000);
  rig.session->feed(rig.now, AirRig::k_unix_us, other.pack(position));
  EXPECT_FALSE(rig.session->status().connected) << "whose mode it is now is not known";
  rig.link_down = false;
  rig.run(2);
  EXPECT_TRUE(rig.session->status().connected);
}

TEST_P(Conditions, AFailsafeThatReturnsWhileTheLinkWasCutIsNotOverridden) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(3);
  rig.link_down = true;
  rig.run(12);
  ASSERT_EQ(rig.autopilot.custom_mode(), dialect().return_home);
  rig.link_down = false;
  const double at = rig.now;
  rig.run(6);
  EXPECT_EQ(rig.autopilot.custom_mode(), dialect().return_home) << "an owed hold came 10 ms after";
  EXPECT_EQ(kinds(rig.since(at)), "");
  EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 120)) << rig.reason();
}

TEST_P(Conditions, EveryFailsafeIsATakeOver) {
  for (const auto failsafe : {Failsafe::radio, Failsafe::ekf, Failsafe::station}) {
    AirRig rig(options());
    ASSERT_TRUE(rig.fly());
    rig.autopilot.fail(failsafe);
    rig.run(1.5);
    EXPECT_TRUE(rig.control->taken_over());
    const double at = rig.now;
    EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 120));
    EXPECT_EQ(kinds(rig.since(at)), "");
  }
}

TEST_P(Conditions, HoldThenResumeWithinARoundTripEndsInFlight) {
  auto o = options();
  o.latency_s = 0.25;
  o.mode_lag_s = 0.3;
  AirRig rig(o);
  ASSERT_TRUE(rig.fly());
  rig.run(1);
  rig.act("hold");
  rig.run(0.1);
  rig.act("resume");
  rig.run(6);
  EXPECT_EQ(rig.autopilot.custom_mode(), dialect().guided);
  EXPECT_FALSE(rig.control->taken_over()) << rig.reason();
  EXPECT_TRUE(rig.run_until([&] { return rig.step_now() != Step::go_to_waypoint; }, 60)) << "it flies on";
}

TEST_P(Conditions, AnOperatorTakesBackAndFliesOn) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.autopilot.pilot_takes_over(pilots());
  rig.run(3);
  EXPECT_NE(rig.act("skip"), "") << "only resume, hold, return and land take it back";
  EXPECT_EQ(rig.act("resume"), "");
  rig.run(3);
  EXPECT_EQ(rig.autopilot.custom_mode(), dialect().guided);
  EXPECT_FALSE(rig.control->taken_over());
}

TEST_P(Conditions, LateAnswersDecideNothingOfANewerCommand) {
  auto o = options();
  o.ack_delay_s = 1.2;
  AirRig rig(o);
  ASSERT_TRUE(rig.fly());
  rig.run(3);
  rig.act("hold");
  rig.run(0.3);
  rig.act("land");
  rig.autopilot.options().loss_in = 1;  // the answer to hold is on its way, land never arrives
  EXPECT_TRUE(rig.run_until([&] { return rig.fate("land") != CommandState::sent; }, 4));
  EXPECT_TRUE(rig.fate("land") == CommandState::unconfirmed || rig.autopilot.custom_mode() == dialect().land);
}

// Two positions, one truth.

TEST_P(Conditions, AnOrdinaryGnssErrorIsFlownWithoutWaiting) {
  auto o = options();
  o.gnss_offset_m = {1.0, -0.9, 1.2};
  AirRig rig(o);
  ASSERT_TRUE(rig.fly()) << rig.reason();
  ASSERT_TRUE(rig.until_step(Step::search_anchors, 30)) << "it hovered 1.16 m off for 90 s a try";
  EXPECT_LT((rig.rover() - Eigen::Vector3d(-8, -5, 4)).norm(), 0.6);
  rig.act("return");
  EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 60)) << "it stood 12 minutes above home";
  EXPECT_LT((rig.rover() - rig.home).head<2>().norm(), 2.5);
}

TEST_P(Conditions, ABarometerThatDriftsDoesNotBringItBelowTheBand) {
  for (const double drift_mps : {0.05, -0.05}) {
    auto o = options();
    o.baro_drift_mps = drift_mps;
    AirRig rig(o);
    ASSERT_TRUE(rig.fly());
    rig.run(30);
    ASSERT_NE(rig.step_now(), Step::landing);
    EXPECT_GT(rig.lowest_m, 1.5) << drift_mps;
    rig.act("hold");  // in the autopilot's own hold nobody corrects: the floor does
    rig.lowest_m = 1e9;
    rig.run(120);
    EXPECT_GT(rig.lowest_m, 1.2) << drift_mps;
    rig.act("return");
    EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 180)) << rig.reason();
  }
}

// Told to return without RTK it flies by itself and lands, through the lower end of the band: it was sent up
// again from there, and then home, for as long as the battery lasted.
TEST_P(Conditions, TheAutopilotsOwnReturnIsLeftToLand) {
  for (const bool rtk_comes_back : {false, true}) {
    AirRig rig(options());
    ASSERT_TRUE(rig.fly());
    rig.run(4);
    rig.rtk_lost = true;
    ASSERT_TRUE(rig.until_step(Step::return_home, 15)) << rig.reason();
    rig.run(1);
    const double at = rig.now;
    rig.rtk_lost = !rtk_comes_back;
    EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 90)) << rig.reason();
    EXPECT_EQ(kinds(rig.since(at)), "");
  }
}

TEST_P(Conditions, AHeightWithoutRtkSendsNobodyUp) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.act("hold");
  rig.run(5);
  rig.rtk_lost = true;
  const double at = rig.now;
  while (rig.now < at + 8) {
    rig.control->fix(rig.now, rig.rover() - Eigen::Vector3d(0, 0, 4), FixClass::single);
    rig.step();
  }
  for (const auto& h : rig.events) EXPECT_NE(h.code, "fence.breach") << h.text;
}

// The rest.

TEST_P(Conditions, ItFliesAsFastAsThePlanSays) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.silent_anchors = true;
  double fastest = 0;
  for (int i = 0; i < 400; ++i) {
    rig.run(0.1);
    fastest = std::max(fastest, rig.autopilot.vehicle().velocity_mps().norm());
  }
  EXPECT_LT(fastest, 2.6) << "8.2 m/s were flown";
  EXPECT_GT(fastest, 1.0);
}

TEST_P(Conditions, ATakeOffIsRelativeToWhereItStands) {
  for (const double ground_m : {-3.0, 0.0, 3.0}) {
    AirRig rig(options(), {-9, -9, ground_m});
    ASSERT_TRUE(rig.fly()) << ground_m << ' ' << rig.reason();
    EXPECT_GT(rig.rover().z(), ground_m + 3.4);
    EXPECT_LT(rig.rover().z(), std::max(ground_m + 5.0, 3.5));
  }
}

TEST_P(Conditions, LandedAndDisarmedByThePilotEndsTheFlightInEveryStep) {
  for (const double after_s : {0.5, 6.0, 9.0, 14.0, 22.0}) {
    AirRig rig(options());
    ASSERT_TRUE(rig.fly());
    rig.run(after_s);
    rig.autopilot.pilot_lands();
    EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 60)) << after_s << ' ' << rig.reason();
  }
}

TEST_P(Conditions, AServerThatWasKilledHoldsByItselfOnlyWhatItFlew) {
  for (const bool pilot_took_it : {false, true}) {
    AirRig rig(options());
    ASSERT_TRUE(rig.fly());
    rig.run(1);
    if (pilot_took_it) rig.autopilot.pilot_takes_over(pilots());
    rig.restart_server(2);
    const double at = rig.now;
    rig.run(3);
    if (pilot_took_it) {
      EXPECT_EQ(kinds(rig.since(at)), "");
      EXPECT_TRUE(rig.control->taken_over());
    } else {
      ASSERT_FALSE(rig.since(at).empty());
      EXPECT_EQ(rig.since(at).front().mode, dialect().hold);
      EXPECT_EQ(rig.step_now(), Step::hold);
      rig.act("resume");
      rig.run(4);
      EXPECT_EQ(rig.autopilot.custom_mode(), dialect().guided);
    }
  }
}

// Between the first heartbeat after the restart and the next round of the procedure it was "not sent".
TEST_P(Conditions, AnOrderRightAfterARestartReachesTheWire) {
  for (const char* action : {"hold", "land"}) {
    for (const int early : {0, 1}) {
      AirRig rig(options());
      ASSERT_TRUE(rig.fly());
      rig.run(1);
      rig.restart_server(2);
      for (int i = 0; i < early; ++i) rig.step();
      ASSERT_TRUE(rig.run_until([&] { return rig.session->status().connected; }, 3));
      const auto before = rig.wire.size();
      EXPECT_EQ(rig.act(action), "");
      EXPECT_GT(rig.wire.size(), before) << action << ' ' << early;
    }
  }
}

TEST_P(Conditions, FliesAWholePlanOnAPoorLink) {
  auto o = options();
  o.loss = o.loss_in = 0.3;
  o.latency_s = 0.25;
  o.duplicate = 0.1;
  o.gnss_offset_m = {1.0, 1.0, 0.5};
  AirRig rig(o);
  ASSERT_TRUE(rig.fly()) << rig.reason();
  EXPECT_TRUE(rig.run_until([&] { return rig.done(); }, 600)) << rig.reason();
  EXPECT_LT((rig.rover() - rig.home).head<2>().norm(), 3.0) << rig.reason();
}

}  // namespace
}  // namespace anchord::test::conditions_test
