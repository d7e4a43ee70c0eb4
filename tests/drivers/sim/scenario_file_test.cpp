#include "drivers/sim/scenario_file.hpp"

#include <gtest/gtest.h>

namespace anchord::sim::scenario_file_test {
namespace {

TEST(ScenarioFile, TakesWhatItSaysAndLeavesTheRestAsInTheDemonstration) {
  const auto read = parse_scenario(R"({"schema":"anchord.scenario/1","name":"shed","seed":9,
    "world":{"origin":{"lat_deg":50,"lon_deg":4,"height_m":100},"length_m":8,"width_m":5,"height_m":3,
      "walls":[{"from_m":[0,0],"to_m":[8,0],"material":"brick","thickness_m":0.3,"excess_m":0.5}],
      "floors":[{"outline_m":[[0,0],[8,0],[8,5],[0,5]],"height_m":3,"material":"tin","loss_db":20}],
      "anchors":[{"id":"0x6a01","enu_m":[1,1,2]}]},
    "path":{"rings":{"clearance_m":3,"heights_m":[2,4]},"speed_mps":1.5},
    "tags":[{"name":"a","id":"0x6e02"},{"name":"b","id":"0x6e03","range_s":0.02}],
    "rovers":[{"name":"r","format":"ubx","port":"pty","rate_hz":5}],
    "faults":[{"device":"b","kind":"unplug","from_s":10,"until_s":12.5}]})");
  ASSERT_TRUE(read) << read.error().message;
  const Scenario& s = read.value();
  EXPECT_EQ(s.seed, 9u);
  ASSERT_EQ(s.world.panels.size(), 1u);
  EXPECT_EQ(s.world.panels[0].excess_m, 0.5);
  EXPECT_EQ(s.world.panels[0].side_b_m.z(), 3);
  EXPECT_EQ(s.world.slabs.at(0).material.loss_db, 20);
  EXPECT_EQ(s.world.anchors.at(0).id, NetworkId{0x6a01});
  EXPECT_EQ(s.tags.at(1).range_s, 0.02);
  EXPECT_EQ(s.rovers.at(0).format, RoverFormat::ubx);
  EXPECT_EQ(s.rovers.at(0).port, RoverPort::pty);
  ASSERT_EQ(s.faults.size(), 1u);
  EXPECT_EQ(s.faults[0].kind, FaultKind::unplug);
  EXPECT_EQ(s.radio.turn_lobe_db, scenario_radio().turn_lobe_db);
}

TEST(ScenarioFile, NamesWhatIsWrong) {
  const auto why = [](const std::string& inside) {
    const auto read = parse_scenario(R"({"schema":"anchord.scenario/1")" + inside + "}");
    return read ? std::string() : read.error().message;
  };
  EXPECT_EQ(why(""), "");
  EXPECT_EQ(why(R"(,"sead":1)"), "/sead is not a known key");
  EXPECT_EQ(why(R"(,"world":{"walls":[{"from_m":[0,0],"to_m":[1]}]})"),
            "/world/walls/0/to_m must be 2 numbers");
  EXPECT_EQ(why(R"(,"rovers":[{"format":"xml"}])"),
            "/rovers/0/format must be one of nmea, ubx, erb, llh, gpsd");
  EXPECT_EQ(why(R"(,"faults":[{"device":"nobody","kind":"zero"}])"),
            "a fault names an unknown device: nobody");
  EXPECT_EQ(why(R"(,"seed":1.5)"), "/seed must be a whole number up to 9007199254740992");
  EXPECT_NE(why(R"(,"world":{"walls":[{"from_m":[0,0],"to_m":[1,0],"material":"mud"}]})"), "");
  EXPECT_FALSE(parse_scenario("{"));
  EXPECT_FALSE(parse_scenario("[]"));
  EXPECT_TRUE(read_scenario("demonstration"));
  EXPECT_EQ(read_scenario("/nowhere").error().code, Errc::not_found);
}

}  // namespace
}  // namespace anchord::sim::scenario_file_test
