#include "drivers/sim/rover.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "drivers/gnss/decoder.hpp"

namespace anchord::sim::rover_test {
namespace {

std::string hex(std::string_view bytes) {
  std::string out;
  char pair[4];
  for (const char c : bytes) {
    std::snprintf(pair, sizeof pair, "%02x ", static_cast<unsigned>(static_cast<unsigned char>(c)));
    out += pair;
  }
  if (!out.empty()) out.pop_back();
  return out;
}

/// The epoch of the protocol descriptions' examples: 2024-06-13 near 09:00 UTC, RTK fixed.
RoverEpoch example(const char* time) {
  RoverEpoch epoch;
  epoch.time = parse_rfc3339(time).value();
  epoch.position = {51.0228123, 3.7104567, 67.512};
  epoch.geoid_separation_m = 45.012;
  epoch.velocity_enu_mps = {0.34, -0.12, -0.02};
  epoch.sigma_enu_m = {0.014, 0, 0.021};
  return epoch;
}

TEST(SimulatedReceiver, WritesNmeaAsTheMakersEncoder) {
  const std::string text = encode(example("2024-06-13T09:00:00.2Z"), RoverFormat::nmea);
  // nmea-rtk, sections 3 and 4 (the station id of the GGA there is another receiver's).
  EXPECT_NE(text.find("$GNRMC,090000.20,A,5101.3687380,N,00342.6274020,E,0.70,109.44,130624,,,D*47\r\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("$GNGGA,090000.20,5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,*"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("$GNVTG,109.44,T,,M,0.70,N,1.30,K,D*2B\r\n"), std::string::npos) << text;
  RoverEpoch none = example("2024-06-13T09:00:00.2Z");
  none.fix = FixClass::none;
  EXPECT_EQ(encode(none, RoverFormat::nmea),
            "$GNRMC,,,,,,,,,,,,*55\r\n$GNGGA,,,,,,,,,,,,,,*48\r\n$GNGST,,,,,,,,,*65\r\n$GNVTG,,,,,,,*60\r\n");
}

TEST(SimulatedReceiver, WritesErbAsTheMakersEncoder) {
  RoverEpoch epoch = example("2024-06-13T08:59:59.8Z");  // tow 378017800
  epoch.velocity_enu_mps = {0.34, -0.12, -0.02};
  const std::string text = hex(encode(epoch, RoverFormat::erb));
  for (const char* frame : {"45 52 01 07 00 08 18 88 16 00 01 00 c7 13",
                            "45 52 02 2c 00 08 18 88 16 ec ca 1d ec 03 af 0d 40 28 39 71 83 eb 82 49 40 54 "
                            "e3 a5 9b c4 e0 50 40 00 00 "
                            "00 00 00 80 36 40 0e 00 00 00 15 00 00 00 b9 91",
                            "45 52 03 09 00 08 18 88 16 0e 09 03 01 0e f3 4e",
                            "45 52 04 0c 00 08 18 88 16 d2 00 aa 00 8c 00 5a 00 30 d2"})
    EXPECT_NE(text.find(frame), std::string::npos) << frame << "\nin\n" << text;
}

TEST(SimulatedReceiver, WritesUbxAsTheMaker) {
  RoverEpoch epoch = example("2024-06-13T08:59:59.8Z");
  epoch.position = {51.022812312, 3.710456666, 67.5123};
  epoch.geoid_separation_m = 45.0125;
  epoch.sigma_enu_m = {0.0142, 0, 0.0213};
  const std::string text = hex(encode(epoch, RoverFormat::ubx));
  EXPECT_NE(
      text.find("b5 62 01 14 24 00 00 00 00 00 08 18 88 16 b7 2b 36 02 9b 76 69 1e b8 07 01 00 e4 57 00 00"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("b5 62 01 07 5c 00 08 18 88 16 e8 07 06 0d 09 00 00 37 19 00 00 00 00 3e 14 f4 03 83"),
            std::string::npos)
      << text;
}

class EachFormat : public ::testing::TestWithParam<RoverFormat> {};

TEST_P(EachFormat, IsReadBackAsItWasFlown) {
  Scenario scenario = demonstration_scenario();
  scenario.rovers[0].format = GetParam();
  scenario.rovers[0].sigma_m = {0.0141, 0.0141, 0.02};
  scenario.rovers[0].delay_s = 0;
  scenario.faults = {{"rover", FaultKind::fix_loss, 4, 5}, {"rover", FaultKind::fix_float, 6, 8}};
  const auto shared = std::make_shared<const Scenario>(scenario);
  const FlightPath path(scenario.path, scenario.speed_mps, true);
  // 3 s before midnight: dates change on the way.
  RoverSim rover(
      shared, scenario.rovers[0], [&](double t) { return path.at(t); },
      parse_rfc3339("2026-06-30T23:59:57Z").value());
  gnss::Decoder decoder;
  gnss::Epochs epochs;
  decoder.feed(greeting(GetParam()) + rover.speak(9.95), epochs);
  decoder.finish(epochs);
  int fixed = 0, floats = 0;
  for (const auto& epoch : epochs) {
    if (epoch.fix == FixClass::none) continue;
    ASSERT_TRUE(epoch.time && epoch.lat_deg && epoch.height_ellipsoid_m);
    const double at_s = seconds_between(parse_rfc3339("2026-06-30T23:59:57Z").value(), *epoch.time);
    EXPECT_NEAR(at_s * 10, std::round(at_s * 10), 1e-6);
    const bool is_float = at_s > 5.99 && at_s < 7.95;
    EXPECT_EQ(epoch.fix, is_float ? FixClass::rtk_float : FixClass::rtk_fixed) << at_s;
    (is_float ? floats : fixed)++;
    // Metres north of the origin, by the degree's length; within five sigma of where it flew.
    const double north_m = (*epoch.lat_deg - scenario.world.origin.lat_deg) * 111'200;
    const double sigma_m = is_float ? 0.25 : 0.0141;
    EXPECT_NEAR(north_m, path.at(at_s).enu_m.y(), 5 * sigma_m + 0.3) << at_s;
    EXPECT_NEAR(*epoch.height_ellipsoid_m - scenario.world.origin.height_m, path.at(at_s).enu_m.z(),
                5 * (is_float ? 0.45 : 0.02) + 0.01);
    if (!is_float && epoch.sigma_u_m) {
      EXPECT_NEAR(*epoch.sigma_u_m, 0.02, 0.01);  // ERB tells the whole of it only: 0.028
    }
  }
  EXPECT_EQ(fixed, 70);
  EXPECT_EQ(floats, 20);
}

TEST_P(EachFormat, GivesTheSameBytesWithTheSameSeedHoweverItIsAsked) {
  Scenario scenario = demonstration_scenario();
  scenario.rovers[0].format = GetParam();
  scenario.faults = {{"rover", FaultKind::garbage, 1, 3}};
  const auto shared = std::make_shared<const Scenario>(scenario);
  const FlightPath path(scenario.path, scenario.speed_mps, true);
  const auto where = [&](double t) { return path.at(t); };
  const UtcTime start = parse_rfc3339("2026-05-04T10:00:00Z").value();
  RoverSim one(shared, scenario.rovers[0], where, start), two(shared, scenario.rovers[0], where, start);
  std::string in_steps;
  for (int i = 0; i <= 500; ++i) in_steps += one.speak(i * 0.01);
  EXPECT_EQ(in_steps, two.speak(5.0));
  EXPECT_FALSE(in_steps.empty());
}

INSTANTIATE_TEST_SUITE_P(All, EachFormat,
                         ::testing::Values(RoverFormat::nmea, RoverFormat::ubx, RoverFormat::erb,
                                           RoverFormat::llh, RoverFormat::gpsd),
                         [](const auto& each) { return std::string(to_string(each.param)); });

}  // namespace
}  // namespace anchord::sim::rover_test
