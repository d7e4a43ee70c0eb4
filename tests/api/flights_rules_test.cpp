// What is shown of a flight over REST, and where one may begin.
#include <chrono>
#include <future>

#include "api/flight/kept_outcome.hpp"
#include "core/flight/flown_time.hpp"
#include "flights_fixture.hpp"

namespace anchord::test::flights_rules_test {
namespace {

/// While a message is sent, another thread asks for what is guarded by the lock that safety is checked under.
class AsksWhileSending final : public api::HubListener {
 public:
  explicit AsksWhileSending(std::function<void()> ask) : ask_(std::move(ask)) {}
  void on_message(api::Topic topic, const std::shared_ptr<const api::LiveMessage>&) override {
    ++sent[topic];
    if (waited.contains(topic)) return;
    asked_.push_back(std::async(std::launch::async, ask_));
    if (asked_.back().wait_for(std::chrono::seconds(2)) != std::future_status::ready) ++waited[topic];
  }
  void on_tick(UtcTime, bool) override {}
  void on_bye(std::uint16_t, std::string_view) override {}
  std::map<api::Topic, int> sent, waited;

 private:
  std::function<void()> ask_;
  std::vector<std::future<void>> asked_;  ///< joined with the listener, when nothing is held any more
};

TEST_F(Flights, TheLockOfTheSafetyChecksIsFreeWhileMessagesAndEventsAreSent) {
  mission_ = mission();
  AsksWhileSending listener([this] { (void)get(base() + "/procedure"); });
  auto membership = app_->hub().join(listener);
  for (const auto topic : {api::Topic::procedure, api::Topic::events, api::Topic::mission_turn})
    membership.subscribe(topic, std::nullopt);
  take_off(mission_);
  fly(5);
  membership = {};
  EXPECT_GE(listener.sent[api::Topic::procedure], 5) << "once a second";
  EXPECT_GE(listener.sent[api::Topic::events], 2) << "control taken, procedure begun";
  EXPECT_EQ(listener.waited, (std::map<api::Topic, int>{}));
}

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
  EXPECT_NE(elsewhere.body.find("take-off point is not known"), std::string::npos) << elsewhere.body;

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

/// Both are of the flight as it was started: what comes of it later is compared with what was promised.
TEST_F(Flights, PriorsThatWereKeptUnderTheirNameUpTo01AreRead) {
  const MissionId id{parse_uuid(mission()).value()};
  const std::string priors =
      R"({"0x6a21":{"bearing":{"from":[51.0231,3.7131,60],"rad":1.2,"sigma_rad":0.4}}})";
  auto& plans = database_->stores().plans;
  for (const std::string name : {"clues", "priors"}) {
    ASSERT_TRUE(plans.keep_procedure(id, R"({"landed":true,")" + name + "\":" + priors + "}", UtcTime{}));
    const auto kept = api::kept_outcome(plans, id).priors;
    ASSERT_EQ(kept.size(), 1u) << name;
    EXPECT_EQ(kept.begin()->second.bearing->bearing_rad, 1.2) << name;
  }
}

TEST_F(Flights, TheFlownTimeIsKeptBesideItsForecast) {
  mission_ = mission();
  const auto plan = make_plan();
  const auto check = json(post("/api/v1/plans/" + plan + "/validate", ""));
  fly(12);
  check_everything();
  const std::string lease = control()["lease"];
  EXPECT_TRUE(json(get(base()))["flight_time"].is_null());
  const double started = drone_->now;
  ASSERT_EQ(act("start", lease, R"(,"plan":")" + plan + '"').status, 202);
  fly(30);
  EXPECT_TRUE(json(get(base()))["flight_time"].is_null()) << "in the air";
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 900)) << procedure().dump(1);
  ASSERT_EQ(procedure()["status"], "done");
  const Json time = json(get(base()))["flight_time"];
  const Json forecast{{"low", check["duration_low_s"]},
                      {"expected", check["duration_s"]},
                      {"high", check["duration_high_s"]}};
  EXPECT_EQ(time["forecast_s"], forecast) << check.dump(1);
  const double flown_s = time["flown_s"], low_s = time["forecast_s"]["low"],
               high_s = time["forecast_s"]["high"];
  EXPECT_NEAR(flown_s, drone_->now - started, 1) << "looked at every half second";
  EXPECT_EQ(time["completed"], true);
  EXPECT_EQ(time["plan_changed"], false);
  EXPECT_EQ(time["against_forecast"], flown_s < low_s ? "shorter" : flown_s > high_s ? "longer" : "within");
  restart();
  EXPECT_EQ(json(get(base()))["flight_time"], time);
  EXPECT_TRUE(json(get("/api/v1/missions/" + mission()))["flight_time"].is_null()) << "of another mission";
}

TEST_F(Flights, ATimeThatWasCutShortIsNotHeldAgainstTheForecast) {
  ASSERT_EQ(act("land", take_off()).status, 202);
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  const Json time = json(get(base()))["flight_time"];
  EXPECT_GT(time["flown_s"], 5.0);
  EXPECT_TRUE(time["forecast_s"].is_object());
  EXPECT_EQ(time["completed"], false);
  EXPECT_TRUE(time["against_forecast"].is_null());
}

TEST(FlownTime, LiesWithinTheSpreadOrOutsideOfOneEndOfIt) {
  using flight::AgainstForecast;
  flight::FlownTime time{.forecast = planning::FlightTime{300, 400, 500}, .completed = true};
  const auto against = [&](double flown_s) {
    time.flown_s = flown_s;
    return time.against();
  };
  EXPECT_EQ(against(299.9), AgainstForecast::shorter);
  for (const double s : {300.0, 400.0, 500.0}) EXPECT_EQ(against(s), AgainstForecast::within) << s;
  EXPECT_EQ(against(500.1), AgainstForecast::longer);
  time.plan_changed = true;
  EXPECT_EQ(against(500.1), std::nullopt) << "another plan was flown";
  time = {.flown_s = 400, .completed = true};
  EXPECT_EQ(time.against(), std::nullopt) << "nothing was forecast";
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
}  // namespace anchord::test::flights_rules_test
