// What keeps the checklist from being green, and in which words.
#include "core/flight/checklist.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace anchord::flight::checklist_test {
namespace {

DroneStatus hears() {
  DroneStatus d;
  d.connected = true;
  d.autopilot = "ArduPilot";
  d.mode = "STABILIZE";
  d.position_age_s = 0.1;
  return d;
}

ChecklistItem drone_item(const DroneStatus& d) {
  ChecklistFacts facts;
  facts.drone = d;
  const auto list = make_checklist(facts);
  return *std::find_if(list.begin(), list.end(), [](const auto& i) { return i.id == "drone"; });
}

TEST(Checklist, TheAircraftThatAnswersAloneIsGreen) {
  const auto item = drone_item(hears());
  EXPECT_TRUE(item.green());
  EXPECT_EQ(item.detail, "ArduPilot, STABILIZE");
}

TEST(Checklist, TwoThatAnswerAsOneAreNotGreenAndNobodyOverridesThat) {
  auto d = hears();
  d.link_trouble = "two autopilots answer as system 1";
  const auto item = drone_item(d);
  EXPECT_FALSE(item.green());
  EXPECT_FALSE(item.overridable);
  EXPECT_EQ(item.detail, "two autopilots answer as system 1");
}

TEST(Checklist, RangesOfATagThatTheMissionDoesNotHaveAreNotGreenAndNameBoth) {
  Mission mission;
  mission.tags = {{NetworkId{0x6e01}, 0, {}}};
  ChecklistFacts facts;
  facts.mission = &mission;
  facts.range_age_s = 0.1;
  const auto tag = [&] {
    const auto list = make_checklist(facts);
    return *std::find_if(list.begin(), list.end(), [](const auto& i) { return i.id == "tag"; });
  };
  EXPECT_TRUE(tag().green());
  facts.unknown_tag = NetworkId{0x6e02};
  EXPECT_FALSE(tag().green());
  EXPECT_EQ(tag().detail,
            "ranges come from tag 0x6e02, which the mission does not have (0x6e01): they are not used");
}

// 600 s of flight with 30 % on top are 780 s: 65 % of 20 minutes, 32.5 % of 40, and 30 % is the reserve.
TEST(Checklist, TheBatteryThatAFlightNeedsFollowsTheEnduranceOfTheAircraft) {
  planning::PlanCheck check;
  check.time.expected_s = 600;
  auto d = hears();
  d.battery = 0.7;
  d.battery_age_s = 0.1;
  ChecklistFacts facts;
  facts.plan = &check;
  facts.drone = d;
  const auto battery = [&] {
    const auto list = make_checklist(facts);
    return *std::find_if(list.begin(), list.end(), [](const auto& i) { return i.id == "battery"; });
  };
  EXPECT_FALSE(battery().green());
  EXPECT_EQ(battery().detail, "70 % left, 95 % needed (endurance on a full battery: 20 min)");
  facts.endurance_s = 2400;
  EXPECT_TRUE(battery().green());
  EXPECT_NE(battery().detail.find("needed (endurance on a full battery: 40 min)"), std::string::npos)
      << battery().detail;
  check.time.expected_s = 2400;
  facts.drone->battery = 1;
  EXPECT_FALSE(battery().green());
  EXPECT_NE(battery().detail.find("divide the plan"), std::string::npos) << battery().detail;
}

TEST(Checklist, NamesAGroundStationThatSendsAsThisOneDoes) {
  const auto stations = [](const DroneStatus& d) {
    ChecklistFacts facts;
    facts.drone = d;
    std::vector<ChecklistItem> out;
    for (const auto& i : make_checklist(facts))
      if (i.id == "station") out.push_back(i);
    return out;
  };
  auto d = hears();
  EXPECT_TRUE(is_checklist_item("station"));
  EXPECT_TRUE(stations(d).empty());
  d.others = {{"10.0.0.7:14550", 255, 190, "ground station", 12, 0.4}};
  ASSERT_EQ(stations(d).size(), 1u);
  EXPECT_FALSE(stations(d)[0].green());
  EXPECT_TRUE(stations(d)[0].overridable);
  EXPECT_NE(stations(d)[0].detail.find("one at 10.0.0.7:14550 sends as system 255, component 190"),
            std::string::npos)
      << stations(d)[0].detail;
  d.others[0].silent_s = 8;
  EXPECT_TRUE(stations(d).empty()) << "it has gone";
  d.others = {{"10.0.0.7:14550", 254, 190, "ground station", 12, 0.4}};
  EXPECT_TRUE(stations(d).empty());
}

TEST(Checklist, SaysWhyNobodyIsFollowed) {
  DroneStatus d;
  EXPECT_EQ(drone_item(d).detail, "no heartbeat");
  d.link_trouble = "system 7 is of kind fixed wing: anchord commands multirotors only, it is not followed";
  EXPECT_FALSE(drone_item(d).green());
  EXPECT_EQ(drone_item(d).detail, d.link_trouble);
}

TEST(Checklist, APositionThatIsNoneIsNotGreen) {
  auto d = hears();
  d.stale = {"GLOBAL_POSITION_INT (it comes, and says no place)"};
  EXPECT_FALSE(drone_item(d).green());
  EXPECT_NE(drone_item(d).detail.find("says no place"), std::string::npos) << drone_item(d).detail;
}

}  // namespace
}  // namespace anchord::flight::checklist_test
