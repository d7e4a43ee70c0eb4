// What is shown of a flight over REST, and where one may begin.
#include "flights_fixture.hpp"

namespace anchord::test {
namespace {

TEST_F(Flights, TheChecklistHasThePreArmStateInTheAutopilotsWordsAndCallsAFloatAFloat) {
  mission_ = mission();
  const auto plan = make_plan();
  fly(12);
  const auto detail = [&](const std::string& id) {
    const Json list = json(get(base() + "/checklist", {{"plan", plan}}));
    for (const auto& item : list["items"]) {
      if (item["id"] == id)
        return item["state"].get<std::string>() + ": " + item["detail"].get<std::string>();
    }
    return std::string("absent");
  };
  EXPECT_EQ(detail("arming").substr(0, 3), "ok:");
  drone_->autopilot.refuse_arming("Compass not healthy");
  fly(2);
  EXPECT_EQ(detail("arming"), "failed: PreArm: Compass not healthy");
  char row[200];
  std::snprintf(row, sizeof row,
                R"({"t_us":%lld,"lon":3.7130,"lat":51.0230,"h_m":55.5,"fix":"float","sigma_m":[0.3,0.3,0.5]})"
                "\n",
                static_cast<long long>(k_unix_us + std::llround(drone_->now * 1e6) + 50'000));
  ASSERT_EQ(post("/api/v1/fixes", row, "application/x-ndjson", {{"mission", mission_}}).status, 200);
  EXPECT_EQ(detail("rtk").substr(0, 17), "failed: RTK float");
}

TEST_F(Flights, CommandsAndDistanceAreThisMissions) {
  const auto lease = take_off();
  ASSERT_EQ(act("land", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  const auto yesterdays = mission_;
  mission_ = mission();
  const auto plan = make_plan();
  fly(12);
  check_everything();
  const std::string second = control(R"({"action":"take","force":true})")["lease"];
  ASSERT_EQ(act("start", second, R"(,"plan":")" + plan + '"').status, 202);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "go_to_waypoint"; }, 60)) << procedure().dump(1);
  const Json now = procedure();
  EXPECT_NE(now["mission"], yesterdays);
  ASSERT_FALSE(now["commands"].empty());
  EXPECT_EQ(now["commands"][0]["action"], "start");
  for (const auto& c : now["commands"]) EXPECT_NE(c["action"], "land") << "of the flight before";
  const auto target = now["target"]["enu_m"];
  const Eigen::Vector3d to(target[0].get<double>(), target[1].get<double>(), target[2].get<double>());
  EXPECT_NEAR(now["distance_m"].get<double>(), (to - drone_->autopilot.vehicle().position_m()).norm(), 1.5);
}

// Home is where it returns to and lands. Begun in the air it would have been up there.
TEST_F(Flights, StartingAgainInTheAirNeedsAHomeOnTheGround) {
  const auto first_lease = take_off();
  const auto first = mission_;
  fly(3);
  ASSERT_EQ(act("abort", first_lease).status, 202);
  fly(3);
  ASSERT_TRUE(drone_->session.status().in_air);

  mission_ = mission();
  auto plan = make_plan();
  fly(12);
  check_everything();
  std::string lease = control(R"({"action":"take","force":true})")["lease"];
  const auto elsewhere = act("start", lease, R"(,"plan":")" + plan + '"');
  EXPECT_EQ(elsewhere.status, 422);
  EXPECT_NE(elsewhere.body.find("not known where it took off"), std::string::npos) << elsewhere.body;

  mission_ = first;
  plan = make_plan();
  fly(12);
  check_everything();
  lease = control(R"({"action":"take","force":true})")["lease"].get<std::string>();
  const auto again = act("start", lease, R"(,"plan":")" + plan + '"');
  ASSERT_EQ(again.status, 202) << again.body;
  fly(1);
  const std::string step = procedure()["step"];
  EXPECT_TRUE(step == "go_to_waypoint" || step == "search_anchors")
      << "it is up already, maybe there: " << step;
  ASSERT_EQ(act("return", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 120)) << procedure().dump(1);
  EXPECT_LT((drone_->autopilot.vehicle().position_m() - k_home_m).norm(), 2) << "on the ground, at home";
}

/// How far apart the safety checks of a flight are is measured while it is in the air, and only then.
TEST_F(Flights, TheIntervalOfSafetyChecksIsMeasuredInTheAir) {
  const auto figure = [&](const std::string& name) {
    const std::string text = get("/metrics").body, line = "\nanchord_safety_interval_seconds" + name + ' ';
    const auto at = text.find(line);
    EXPECT_NE(at, std::string::npos) << text;
    return at == std::string::npos ? -1 : std::stod(text.substr(at + line.size()));
  };
  EXPECT_EQ(figure("_count"), 0);
  const auto lease = take_off();
  const double n = figure("_count");
  fly(5);
  EXPECT_EQ(figure("_count"), n + 50) << "ten a second";
  EXPECT_NEAR(figure("_worst"), 0.1, 1e-6);
  EXPECT_EQ(figure("_bucket{le=\"0.11\"}"), n + 50);
  drone_->run_until(drone_->now + 0.7);  // nobody looks
  fly(1);
  EXPECT_NEAR(figure("_worst"), 0.8, 1e-6);
  EXPECT_EQ(figure("_bucket{le=\"0.5\"}"), n + 59);
  EXPECT_EQ(figure("_bucket{le=\"1\"}"), n + 60);
  ASSERT_EQ(act("land", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  const double landed = figure("_count");
  fly(3);
  EXPECT_EQ(figure("_count"), landed) << "on the ground nothing is watched";
}

}  // namespace
}  // namespace anchord::test
