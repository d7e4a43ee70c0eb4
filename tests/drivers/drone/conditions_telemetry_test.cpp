// What telemetry and positions say, and what follows from it, in ArduPilot's and in PX4's dialect.
#include "conditions.hpp"

namespace anchord::test::conditions_telemetry_test {
namespace {

class TelemetryConditions : public Conditions {};
INSTANTIATE_TEST_SUITE_P(Dialects, TelemetryConditions,
                         ::testing::Values(Autopilot::ardupilot, Autopilot::px4),
                         [](const auto& given) { return std::string(drone::dialect_of(given.param).name); });

// It was hovering while the server said that it stands on the ground.
TEST_P(TelemetryConditions, AnAircraftWhoseLandedStateIsUnknownCountsAsFlying) {
  AirRig rig(options());
  rig.run(7);
  ASSERT_FALSE(rig.session->status().in_air);
  rig.autopilot.options().old_streams = true;
  ASSERT_TRUE(rig.autopilot.restart());
  rig.run(6);
  rig.autopilot.vehicle().arm();
  rig.autopilot.vehicle().take_off(4);
  rig.run(3);
  EXPECT_TRUE(rig.session->status().in_air);
}

TEST_P(TelemetryConditions, TheVoltageCountsWhateverTheShareSays) {
  for (const auto& [sag_v, wanted] : {std::pair{3.0, Step::return_home}, {4.0, Step::landing}}) {
    AirRig rig(options());
    ASSERT_TRUE(rig.fly());
    rig.run(1);
    rig.autopilot.options().sag_v = sag_v;  // four cells: 16.6 V at 95 %
    EXPECT_TRUE(rig.until_step(wanted, 30)) << sag_v << ' ' << rig.reason();
    EXPECT_GT(rig.session->status().battery.value_or(0), 0.8);
  }
}

TEST_P(TelemetryConditions, PositionsThatDisagreeHoldItUntilTheyClearlyAgree) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.run(2);
  const auto alarmed = [&] {
    return rig.control->engine().alarm() && rig.control->engine().alarm()->id == "position.disagree";
  };
  for (const auto& [off_m, alarm] : {std::pair{2.6, false}, {3.6, true}, {2.6, true}, {1.5, false}}) {
    rig.autopilot.options().gnss_offset_m = {off_m, 0, 0};
    rig.run(5);
    EXPECT_EQ(alarmed(), alarm) << off_m << " m";
  }
}

TEST_P(TelemetryConditions, DisarmIsSentWhateverTheServerBelievesAndNeverByForce) {
  AirRig rig(options());
  ASSERT_TRUE(rig.fly());
  rig.act("abort");
  rig.run(3);
  const double at = rig.now;
  EXPECT_EQ(rig.act("disarm"), "");
  const auto sent = rig.since(at - 0.001);
  ASSERT_FALSE(sent.empty());
  EXPECT_EQ(sent.front().command, 400);
  EXPECT_EQ(sent.front().p1, 0);
  rig.run(3);
  EXPECT_TRUE(rig.autopilot.vehicle().armed()) << "in the air it is refused";
  EXPECT_EQ(rig.fate("disarm"), CommandState::refused);
}

}  // namespace
}  // namespace anchord::test::conditions_telemetry_test
