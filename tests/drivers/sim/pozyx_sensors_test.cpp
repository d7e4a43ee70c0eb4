#include "drivers/sim/pozyx_sensors.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/drivers/sim/pozyx_host.hpp"

namespace anchord::sim::pozyx_sensors_test {
namespace {

/// Its nose to the east.
Scenario facing_east() {
  Scenario scenario = open_field();
  scenario.path[0].heading_rad = std::numbers::pi / 2;
  return scenario;
}

// Units of the description's section 8, by hand: 101 325 000 mPa; 1000 mg; 20 uT north, to the left, and 45
// down, each times 16; 90 degrees times 16; half of them as a quaternion times 16384; 24 degrees.
TEST(SimulatedSensors, ReadInTheUnitsOfTheDescriptionWithoutAModeBeingSet) {
  Host host(facing_east());
  EXPECT_EQ(host.ask("R,50,4"), "D,C8180A06");
  EXPECT_EQ(host.ask("R,54,6"), "D,00000000E803");
  EXPECT_EQ(host.ask("R,5a,6"), "D,0000400130FD");
  EXPECT_EQ(host.ask("R,60,6"), "D,000000000000");
  EXPECT_EQ(host.ask("R,66,6"), "D,A00500000000");
  EXPECT_EQ(host.ask("R,6c,8"), "D,412D00000000BFD2");
  EXPECT_EQ(host.ask("R,74,6"), "D,000000000000");
  EXPECT_EQ(host.ask("R,7a,6"), "D,00000000E803");
  EXPECT_EQ(host.ask("R,80,1"), "D,18");
}

TEST(SimulatedSensors, AreSilentWhereTheModeSwitchesThemOff) {
  Host host(facing_east());
  host.ask("W,23,00");
  EXPECT_EQ(host.ask("R,54,28"), "D," + std::string(56, '0'));
  host.ask("W,23,02");  // magnetometer alone
  EXPECT_EQ(host.ask("R,54,12"), "D,0000000000000000400130FD");
  host.ask("W,23,08");  // fusion without it
  EXPECT_EQ(host.ask("R,5a,6"), "D,000000000000");
  EXPECT_EQ(host.ask("R,66,2"), "D,A005");
  host.ask("W,23,0d");
  EXPECT_EQ(host.ask("R,23,1"), "D,08") << "there is no mode 13";
}

TEST(SimulatedSensors, FeelATurnToTheRight) {
  Scenario scenario = open_field();
  scenario.path[0].turn = true;
  scenario.path[0].hold_s = 36;  // ten degrees a second
  Host host(scenario);
  host.now_s = 5;
  host.ask("R,60,6");
  host.now_s = 5.2;
  const Bytes gyro = parse_reply(host.ask("R,60,6"), 6).value();
  EXPECT_NEAR(i16_at(gyro, 4) / 16.0, -10, 0.1);  // about the axis that points up
}

// The maker's test of the sensors counts events in a mode that it has set.
TEST(SimulatedSensors, TellOfAHundredMeasurementsASecondOnceAModeIsSet) {
  Host host(facing_east());
  host.ask("W,23,0c");
  int events = 0;
  for (const double until_s = host.now_s + 2; host.now_s < until_s; host.now_s += 0.001)
    events += (parse_reply(host.ask("R,05,1"), 1).value()[0] & event::imu) != 0;
  EXPECT_NEAR(events, 200, 5);
}

// Its orientation tutorial polls for them for 10 ms, again and again, and never sets a mode.
TEST(SimulatedSensors, TellAHostThatOnlyWaitsForThem) {
  Host host(facing_east());
  EXPECT_EQ(host.ask("R,05,1"), "D,00");
  EXPECT_EQ(host.poll(event::imu, 0.05), event::imu);
  host.ask("R,50,28");
  EXPECT_EQ(host.poll(event::imu, 0.05), event::imu);
  EXPECT_EQ(host.range("0160"), event::func) << "but not one that waits for a range";
  EXPECT_EQ(host.ask("R,05,1"), "D,00");
}

TEST(SimulatedSensors, AreNoneInAnAnchor) {
  Host host(facing_east());
  host.ask("F,b2,005031,1");  // 49 bytes from register 50 of 0x6001
  host.ask("F,b3,016002,1");
  host.now_s += 0.1;
  EXPECT_EQ(host.ask("R,82,3"), "D,016031");
  EXPECT_EQ(host.ask("F,b4,0031,50"), "D,01" + std::string(98, '0'));
}

}  // namespace
}  // namespace anchord::sim::pozyx_sensors_test
