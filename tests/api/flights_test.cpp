// A flight over REST against the simulated autopilot, through the real session: plan, checklist, control,
// start, hold, resume, land; strangers, a silent aircraft, a server killed in flight. Time is the test's,
// nothing sleeps.
#include <sqlite3.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <thread>

#include "api/flight/procedure_json.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/plan_store.hpp"
#include "drivers/sim/wgs84.hpp"
#include "flights_fixture.hpp"

namespace anchord::test::flights_test {
namespace {

TEST_F(Flights, StartIsBlockedUntilTheChecklistIsGreen) {
  mission_ = mission();
  const auto plan = make_plan();
  const std::string lease = control()["lease"];
  const auto early = act("start", lease, R"(,"plan":")" + plan + '"');
  EXPECT_EQ(early.status, 422);
  EXPECT_NE(early.body.find("rtk"), std::string::npos) << early.body;
  fly(12);
  const auto list = [&] { return json(get(base() + "/checklist", {{"plan", plan}})); };
  EXPECT_EQ(list()["ready"], false);
  for (const auto& item : Json(list()["items"])) {
    if (item["id"] == "rtk" || item["id"] == "drone" || item["id"] == "plan") {
      EXPECT_EQ(item["state"], "ok") << item;
    }
    if (item["id"] == "props") {
      EXPECT_EQ(item["state"], "open") << item;
    }
  }
  check_everything();
  EXPECT_EQ(list()["ready"], true) << list().dump(1);
  EXPECT_EQ(post(base() + "/checklist/plan", R"({"reason":"never mind"})").status, 422) << "not overridable";
  EXPECT_EQ(post(base() + "/checklist/weather", R"({"reason":"sunny"})").status, 404);
  EXPECT_EQ(act("start", lease, R"(,"plan":")" + plan + '"').status, 202);
}

TEST_F(Flights, TheChecklistJudgesThePlaceOfTheTakeOffAsTheFlightWill) {
  mission_ = mission();
  const auto place = [&](const std::string& plan) {
    const Json list = json(get(base() + "/checklist", {{"plan", plan}}));
    for (const auto& item : list["items"]) {
      if (item["id"] == "place") return item;
    }
    return Json();
  };
  const auto good = make_plan();
  EXPECT_EQ(place(good)["state"], "failed");
  EXPECT_NE(place(good).value("detail", "").find("its position is not known"), std::string::npos);
  fly(2);
  EXPECT_EQ(place(good)["state"], "ok") << place(good);
  // It stands 9 m west and 9 m south of the corner.
  const auto bad = make_plan(
      R"("no_fly":[{"type":"Polygon","coordinates":[[[3.71290,51.02298],[3.71301,51.02298],[3.71301,51.02306],[3.71290,51.02306]]]}],)");
  EXPECT_EQ(place(bad)["state"], "failed") << place(bad);
  EXPECT_EQ(place(bad).value("detail", ""),
            "no take-off from here: over the building or inside a no-fly area");
  EXPECT_EQ(post(base() + "/checklist/place", R"({"reason":"it will do"})").status, 422) << "not overridable";
}

TEST_F(Flights, StartsHoldsResumesAndLands) {
  const auto lease = take_off();
  EXPECT_EQ(command_state(start_), "accepted");
  EXPECT_EQ(procedure()["status"], "running");
  fly(3);
  const auto hold = act("hold", lease);
  ASSERT_EQ(hold.status, 202) << hold.body;
  fly(2.2);
  EXPECT_EQ(command_state(json(hold)["number"]), "accepted");
  EXPECT_EQ(procedure()["status"], "hold");
  EXPECT_EQ(drone_->session.status().mode, "BRAKE");
  ASSERT_EQ(act("resume", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60));
  EXPECT_LT((drone_->autopilot.vehicle().position_m() - Eigen::Vector3d(-7, -5.6, 4)).norm(), 1.0);
  ASSERT_EQ(act("land", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  EXPECT_EQ(procedure()["status"], "aborted") << "DONE is only what was promised";
  EXPECT_EQ(procedure().value("ended", "").rfind("commanded to land: by ", 0), 0u) << procedure()["ended"];
  EXPECT_FALSE(drone_->autopilot.vehicle().armed());
  for (const char* always : {"hold", "land", "disarm"})
    EXPECT_EQ(act(always, lease).status, 202) << always << ": sent, whatever the server believes";
  EXPECT_EQ(act("return", lease).status, 422) << "nothing flies any more";
}

TEST_F(Flights, AbortedInTheAirAreFinishedByNobodyElseBeforeTheyHaveLanded) {
  const auto lease = take_off();
  fly(3);
  ASSERT_EQ(act("abort", lease).status, 202);
  fly(3);
  ASSERT_EQ(procedure()["status"], "aborted");
  ASSERT_TRUE(drone_->session.status().in_air);
  EXPECT_EQ(post(base() + "/actions", R"({"action":"finish"})").status, 409);
  ASSERT_EQ(act("land", lease).status, 202);
  ASSERT_TRUE(fly_until([&] { return !drone_->session.status().in_air; }, 60));
  fly(1);
  EXPECT_EQ(post(base() + "/actions", R"({"action":"finish"})").status, 200);
}

TEST_F(Flights, KeepWhatTheirProcedureShowedOfEveryStep) {
  const auto lease = take_off();
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60));
  ASSERT_EQ(act("land", lease).status, 202);
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  const auto last = procedure();
  Json shown = Json::array();
  const auto read = [&] {
    shown = Json::array();
    for (Json cursor = "0"; !cursor.is_null();) {
      const Json page = json(get(base() + "/procedure-log", {{"limit", "2"}, {"cursor", cursor}}));
      for (const auto& item : page["items"]) shown.push_back(item);
      cursor = page["next_cursor"];
    }
    return !shown.empty() && shown.back()["data"]["step"] == "done";
  };
  ASSERT_TRUE(fly_until(read, 5)) << shown.dump(1);
  std::set<std::string> steps;
  std::int64_t t_us = 0;
  EXPECT_EQ(shown[0]["topic"], "plan");
  EXPECT_EQ(shown[0]["data"]["plan"]["waypoints"], json(get(base() + "/plan"))["plan"]["waypoints"]);
  shown.erase(0);
  for (const auto& item : shown) {
    EXPECT_EQ(item["topic"], "procedure");
    EXPECT_GE(item["t_us"], t_us) << "in the order of the flight";
    EXPECT_EQ(item["data"]["mission"], mission_);
    t_us = item["t_us"];
    steps.insert(item["data"]["step"]);
  }
  const auto events = json(get(base() + "/events", {{"limit", "1000"}}))["items"];
  for (const auto& event : events) {
    const std::string code = event["code"];
    if (!code.starts_with("procedure.")) continue;
    EXPECT_TRUE(steps.contains(code.substr(10))) << code << ": " << event["text"];
  }
  EXPECT_GE(steps.size(), 4u);
  EXPECT_EQ(shown.back()["data"]["ended"], last["ended"]);
  EXPECT_EQ(get(base() + "/procedure-log", {{"cursor", "x"}}).status, 422);
}

class BusyFlights : public Flights {
 protected:
  /// The flight is in the air; whoever holds `live` from here on keeps its strand busy.
  auto take_off_with(HeldExecutor& live) {
    live.holding = false;
    live_ = &live;
    app_.reset();
    database_.reset();
    open();
    return take_off();
  }
};

/// Two seconds without a position are a hold, ten the way home: an engineer who excludes rows of a long
/// flight in the air must cause neither.
TEST_F(BusyFlights, KeepTheirPositionWhileTheirRowsAreReadAgain) {
  HeldExecutor live;
  const auto lease = take_off_with(live);
  live.holding = true;
  const auto since = k_unix_us + std::llround(drone_->now * 1e6) - 5'000'000;
  const Json exclusion{{"kind", "fixes"},
                       {"since", since},
                       {"until", since + 1'000'000},
                       {"reason", "a crane stood in the way"}};
  ASSERT_EQ(post(base() + "/exclusions", exclusion.dump()).status, 201) << exclusion;
  fly(12);
  EXPECT_EQ(drone_->holds, 0);
  EXPECT_EQ(procedure()["status"], "running") << procedure().dump(1);
  live.holding = false;
  while (live.run_one()) continue;
  fly(3);
  EXPECT_EQ(drone_->holds, 0) << "what waited in the queue is no news";
  EXPECT_EQ(procedure()["status"], "running") << procedure().dump(1);
  EXPECT_EQ(act("land", lease).status, 202);
  app_.reset();
}

/// A solve of hundreds of anchors takes as long.
TEST_F(BusyFlights, KeepTheirPositionWhileEstimatesWait) {
  HeldExecutor live;
  const auto lease = take_off_with(live);
  live.holding = true;
  fly(12);
  EXPECT_GT(live.held(), 0U);
  EXPECT_EQ(drone_->holds, 0);
  EXPECT_EQ(procedure()["status"], "running") << procedure().dump(1);
  live.holding = false;
  while (live.run_one()) continue;
  EXPECT_EQ(act("land", lease).status, 202);
  app_.reset();
}

/// A flight that measures one anchor at (10, 5, 2): the operator who lands finds it solved, once, and not
/// published.
class LandedFlights : public Flights {
 protected:
  void SetUp() override {
    calibrates_ = true;
    Flights::SetUp();
  }
  Json calibrations() { return json(get("/api/v1/calibrations"))["items"]; }
  bool event(const std::string& code) {
    const auto events = json(get(base() + "/events"))["items"];
    return std::ranges::any_of(events, [&](const Json& e) { return e["code"] == code; });
  }
  bool within(double seconds, const std::function<bool()>& done) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!done() && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    return done();
  }
};

TEST_F(LandedFlights, AreCalibratedByThemselvesAndWaitForReview) {
  // The first one lands with nothing measured, and has nothing to solve.
  ASSERT_EQ(act("land", take_off()).status, 202);
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  const auto lease = take_off();
  measure(20);
  EXPECT_TRUE(calibrations().empty()) << "in the air nothing is solved again";
  ASSERT_EQ(act("land", lease).status, 202);
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
  ASSERT_TRUE(within(60, [&] { return calibrations().size() == 1; }));
  const auto made = calibrations()[0];
  EXPECT_EQ(made["missions"], Json::array({mission_}));
  EXPECT_EQ(made["n_anchors"], 1);
  EXPECT_EQ(made["settings"]["after_landing"], true);
  EXPECT_EQ(json(get("/api/v1/jobs"))["items"].size(), 1u) << "one job for the two landings";
  EXPECT_TRUE(event("calibration.after_landing"));
  EXPECT_TRUE(json(get("/api/v1/calibrations/" + made["id"].get<std::string>()))["published"].empty());
  EXPECT_TRUE(json(get("/api/v1/revisions"))["items"].empty()) << "a person publishes";
}

/// Of one heading: a wrong lever arm would not show.
TEST_F(LandedFlights, HoldTheLeverArmSigmaOfTheirMissionWithoutBeingAskedAgain) {
  faces_east_ = true;
  Json declared{{"name", "one heading"},
                {"frame", "wgs84"},
                {"track_point", "gnss_antenna"},
                {"tags", Json::array({{{"tag", "0x6e01"}, {"lever_arm_body_m", {0, 0, 0}}}})}};
  for (const Json& sigma_m : {Json(nullptr), Json(0.02)}) {
    declared["lever_arm_sigma_m"] = sigma_m;
    const auto made = post("/api/v1/missions", declared.dump());
    ASSERT_EQ(made.status, 201) << made.body;
    EXPECT_EQ(json(made)["lever_arm_sigma_m"], sigma_m);
    const auto before = calibrations().size();
    const auto lease = take_off(json(made)["id"]);
    EXPECT_EQ(json(get(base()))["lever_arm_sigma_m"], sigma_m);
    measure(20);
    ASSERT_EQ(act("land", lease).status, 202);
    ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "done"; }, 60));
    ASSERT_TRUE(within(60, [&] { return calibrations().size() > before; }));
    const Json solved = json(get("/api/v1/calibrations/" + calibrations()[0]["id"].get<std::string>()));
    EXPECT_EQ(solved["missions"], Json::array({mission_}));
    EXPECT_EQ(solved["provenance"]["flights"][0]["lever_arm_sigma_m"], sigma_m);
    const Json gates = solved["anchors"][0]["quality"]["gates"];
    const auto gate = std::ranges::find_if(gates, [](const Json& g) { return g["name"] == "unseen_arm"; });
    EXPECT_EQ(gate == gates.end(), !sigma_m.is_null()) << "asked only where nobody says: " << gates.dump(1);
  }
}

TEST_F(Flights, ARefusalToArmIsReportedWithinTwoSecondsInTheAutopilotsWords) {
  mission_ = mission();
  const auto plan = make_plan();
  fly(12);
  check_everything();
  drone_->autopilot.refuse_arming("Throttle too high");
  fly(2);
  const auto arming = [&] {
    Json out;
    const Json list = json(get(base() + "/checklist", {{"plan", plan}}));
    for (const auto& item : list["items"]) {
      if (item["id"] == "arming") out = item;
    }
    return out;
  };
  EXPECT_EQ(arming()["state"], "failed");
  EXPECT_NE(arming()["detail"].get<std::string>().find("Throttle too high"), std::string::npos) << arming();
  ASSERT_EQ(post(base() + "/checklist/arming", R"({"reason":"let it say so"})").status, 200);
  const std::string lease = control()["lease"];
  const auto started = act("start", lease, R"(,"plan":")" + plan + '"');
  ASSERT_EQ(started.status, 202) << started.body;
  fly(2);
  EXPECT_EQ(command_state(json(started)["number"]), "refused");
  EXPECT_EQ(procedure()["status"], "aborted");
  EXPECT_NE(procedure()["reason"].get<std::string>().find("Throttle too high"), std::string::npos);
  drone_->autopilot.refuse_arming("");
  fly(15);
  EXPECT_FALSE(drone_->autopilot.vehicle().armed());
}

TEST_F(Flights, NothingOnTheChecklistIsGreenOnStaleTelemetry) {
  mission_ = mission();
  const auto plan = make_plan();
  fly(12);
  const auto state = [&](const std::string& id) {
    std::string out = "absent";
    const Json list = json(get(base() + "/checklist", {{"plan", plan}}));
    for (const auto& item : list["items"]) {
      if (item["id"] == id) out = item["state"];
    }
    return out;
  };
  EXPECT_EQ(state("drone"), "ok");
  EXPECT_EQ(state("parameters"), "ok");
  drone_->autopilot.options().loss_in = 1;  // the requests for its telemetry are lost
  ASSERT_TRUE(drone_->autopilot.restart());
  fly(9);
  for (const char* id : {"drone", "arming", "battery"}) EXPECT_EQ(state(id), "failed") << id;
  drone_->autopilot.options().loss_in = 0;
  EXPECT_TRUE(fly_until([&] { return state("drone") == "ok"; }, 20));
  drone_->autopilot.set_parameter("FS_GCS_ENABLE", 0);
  ASSERT_TRUE(drone_->autopilot.restart());
  EXPECT_TRUE(fly_until([&] { return state("parameters") == "failed"; }, 20));
}

TEST_F(Flights, TheFenceGoesUpWithTheChecklistAndBlocksStartUntilItIsKept) {
  mission_ = mission();
  const auto plan = make_plan(
      R"("fence":{"type":"Polygon","coordinates":[[[3.712,51.022],[3.715,51.022],[3.715,51.0242],[3.712,51.0242]]]},)");
  fly(12);
  check_everything();
  const auto state = [&] {
    std::string out = "absent";
    const Json list = json(get(base() + "/checklist", {{"plan", plan}}));
    for (const auto& item : list["items"]) {
      if (item["id"] == "fence") out = item["state"];
    }
    return out;
  };
  (void)state();
  fly(3);
  EXPECT_EQ(state(), "failed") << "to read the list sends nothing";
  EXPECT_TRUE(drone_->autopilot.fence_list().empty());
  const auto named = R"({"plan":")" + plan + R"("})";
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(api::Method::post, base() + "/checklist", named, viewer).status, 403);
  EXPECT_EQ(post(base() + "/checklist", R"({"plan":"0197a3c9-11aa-7c3d-8e2f-1a2b3c4d5e6f"})").status, 404);
  EXPECT_EQ(post(base() + "/checklist", R"({"plan":"north"})").status, 422);
  EXPECT_EQ(post(base() + "/checklist", "{}").status, 422);
  fly(3);
  EXPECT_TRUE(drone_->autopilot.fence_list().empty()) << "what was refused sends nothing";
  EXPECT_EQ(post(base() + "/checklist", named).status, 200);
  const std::string lease = control()["lease"];
  const auto early = act("start", lease, R"(,"plan":")" + plan + '"');
  EXPECT_EQ(early.status, 422);
  EXPECT_NE(early.body.find("fence"), std::string::npos) << early.body;
  EXPECT_TRUE(fly_until([&] { return state() == "ok"; }, 10));
  EXPECT_EQ(drone_->autopilot.fence_list().size(), 8u)
      << "the fence, and the building as an area to stay out of";
  const Json kept = json(get(base() + "/uploads"));
  ASSERT_EQ(kept["items"].size(), 1u) << kept;
  EXPECT_EQ(kept["items"][0]["what"], "fence");
  EXPECT_EQ(kept["items"][0]["command"]["state"], "accepted");
  EXPECT_EQ(act("start", lease, R"(,"plan":")" + plan + '"').status, 202);
}

TEST_F(Flights, AnAircraftThatKeepsNoFencesMayFlyWhenTheOperatorSaysSo) {
  drone_ = std::make_unique<LoopDrone>(false);
  app_.reset();
  database_.reset();
  open();
  mission_ = mission();
  const auto plan = make_plan(
      R"("fence":{"type":"Polygon","coordinates":[[[3.712,51.022],[3.715,51.022],[3.715,51.0242],[3.712,51.0242]]]},)");
  fly(12);
  check_everything();
  const std::string lease = control()["lease"];
  (void)get(base() + "/checklist", {{"plan", plan}});
  fly(3);
  const auto refused = act("start", lease, R"(,"plan":")" + plan + '"');
  EXPECT_EQ(refused.status, 422);
  ASSERT_EQ(post(base() + "/checklist/fence", R"({"reason":"the server's guard is enough here"})").status,
            200);
  EXPECT_EQ(act("start", lease, R"(,"plan":")" + plan + '"').status, 202);
}

TEST_F(Flights, ARouteIsGivenToTheAircraftByWhoHasControl) {
  mission_ = mission();
  const auto plan = make_plan();
  fly(3);
  const auto give = [&](const std::string& what, const std::string& lease) {
    return post(base() + "/uploads",
                R"({"what":")" + what + R"(","plan":")" + plan + R"(","lease":")" + lease + "\"}");
  };
  EXPECT_EQ(give("route", "").status, 409) << "no control";
  const std::string lease = control()["lease"];
  const auto given = give("route", lease);
  ASSERT_EQ(given.status, 202) << given.body;
  EXPECT_EQ(json(given)["state"], "sent");
  const auto fate = [&] {
    return json(get(base() + "/uploads"))["items"][0]["command"]["state"].get<std::string>();
  };
  EXPECT_TRUE(fly_until([&] { return fate() == "accepted"; }, 10));
  ASSERT_EQ(drone_->autopilot.mission_list().size(), 3u) << "home and two waypoints";
  EXPECT_EQ(drone_->autopilot.mission_list()[1].integer("x"), 510230500);
  EXPECT_NEAR(drone_->autopilot.mission_list()[1].real("z"), 4, 0.1);
  EXPECT_EQ(give("fence", lease).status, 422) << "this plan has none";
  EXPECT_EQ(give("song", lease).status, 422);
  drone_->link_down = true;
  const auto lost = give("route", lease);
  ASSERT_EQ(lost.status, 202) << lost.body;
  EXPECT_TRUE(fly_until([&] { return fate() == "unconfirmed"; }, 20));
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(api::Method::post, base() + "/uploads", R"({"what":"route","plan":")" + plan + "\"}", viewer)
                .status,
            403);
}

TEST_F(Flights, NothingIsGivenToAnAircraftInTheAir) {
  const auto lease = take_off();
  const std::string plan = json(get("/api/v1/plans"))["items"][0]["id"];
  const auto given =
      post(base() + "/uploads", R"({"what":"route","plan":")" + plan + R"(","lease":")" + lease + "\"}");
  EXPECT_EQ(given.status, 422);
  EXPECT_NE(given.body.find("in the air"), std::string::npos) << given.body;
}

TEST_F(Flights, ACommandWithoutAnAnswerIsNotConfirmedWithinTwoSeconds) {
  const auto lease = take_off();
  drone_->link_down = true;
  const auto hold = act("hold", lease);
  fly(2.4);
  EXPECT_EQ(command_state(json(hold)["number"]), "unconfirmed");
}

TEST_F(Flights, GoesOnWhileTheDatabaseTakesNoWriteForHalfAMinute) {
  take_off();
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open((dir_ / "data" / "anchord.db").c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  DeviceBatch unstored;
  std::set<std::string> steps;
  double worst_s = 0;
  for (const double end = drone_->now + 30; drone_->now < end - 1e-9;) {
    drone_->run_until(drone_->now + 0.1);
    Fix fix;
    fix.mission = MissionId{parse_uuid(mission_).value()};
    fix.time = UtcTime::from_us(k_unix_us + std::llround(drone_->now * 1e6));
    fix.position = sim::wgs84_from_enu({51.0231, 3.7131, 55.5}, drone_->autopilot.vehicle().position_m());
    fix.fix = FixClass::rtk_fixed;
    fix.correction_age_s = 0.8;
    DeviceBatch batch;
    batch.fixes.push_back(fix);
    const auto began = std::chrono::steady_clock::now();
    app_->device_rows().live(batch);
    app_->fly();
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
    worst_s = std::max(worst_s, took.count());
    unstored.fixes.push_back(batch.fixes.front());
    const Json now = procedure();
    steps.insert(now["step"]);
    ASSERT_NE(now["status"], "hold") << now["reason"];
  }
  EXPECT_TRUE(steps.contains("search_anchors")) << "the first waypoint was reached: " << Json(steps).dump();
  EXPECT_LT(worst_s, 1.0) << "a database that is locked is waited for 5 s";
  ASSERT_EQ(sqlite3_exec(other, "ROLLBACK", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(other);
  const auto before = json(get(base()))["n_fixes"].get<int>();
  ASSERT_TRUE(app_->device_rows().store(unstored));
  EXPECT_EQ(json(get(base()))["n_fixes"].get<int>(), before + 300);
}

TEST_F(Flights, AKilledServerTellsTheAircraftToHoldBeforeAnythingElse) {
  take_off();
  fly(2);
  const int holds = drone_->holds;
  // Killed: no farewell; the stored state is all there is.
  drone_->targets.clear();
  const double at = drone_->now;
  app_.reset();
  database_.reset();
  const int farewell = drone_->holds - holds;
  EXPECT_EQ(farewell, 1) << "an orderly stop says hold as well";
  open();
  ASSERT_TRUE(drone_->expected) << "any autopilot that is heard would be taken for the aircraft";
  EXPECT_EQ(drone_->expected->system, 1);
  fly(0.5);
  EXPECT_GT(drone_->holds, holds + farewell);
  EXPECT_EQ(procedure()["status"], "hold");
  EXPECT_NE(procedure()["reason"].get<std::string>().find("restarted"), std::string::npos);
  fly(5);
  EXPECT_TRUE(drone_->targets.empty()) << "nothing is flown to before the operator says so";
  const std::string lease = control(R"({"action":"take","force":true})")["lease"];
  ASSERT_EQ(act("resume", lease).status, 202);
  fly(1);
  EXPECT_FALSE(drone_->targets.empty());
  EXPECT_GT(drone_->now, at);
}

TEST_F(Flights, WhatATurnToldOutlivesTheFlightAndIsNoFlightToGoOnWith) {
  mission_ = mission();
  const MissionId id{parse_uuid(mission_).value()};
  const std::string kept =
      R"({"landed":true,"clues":{"0x6a21":{"bearing":{"from":[51.0231,3.7131,60],"rad":1.2,"sigma_rad":0.4}}}})";
  ASSERT_TRUE(database_->stores().plans.keep_procedure(id, kept, UtcTime{}));
  app_.reset();
  database_.reset();
  const int holds = drone_->holds;
  open();
  fly(1);
  EXPECT_EQ(get(base() + "/procedure").status, 404);
  EXPECT_EQ(drone_->holds, holds) << "nothing flies, nothing is told to hold";
  const auto stored = database_->stores().plans.procedures();
  ASSERT_TRUE(stored);
  ASSERT_EQ(stored.value().size(), 1u);
  EXPECT_EQ(stored.value()[0].second, kept);
}

TEST_F(Flights, WhenThePilotTakesOverNothingIsSentUntilTheOperatorTakesItBack) {
  const auto lease = take_off();
  fly(4);
  drone_->autopilot.pilot_takes_over(5);  // LOITER
  fly(3);
  EXPECT_EQ(procedure()["status"], "hold");
  EXPECT_EQ(drone_->autopilot.custom_mode(), 5u) << "the pilot's mode stays";
  drone_->targets.clear();
  fly(3);
  EXPECT_TRUE(drone_->targets.empty());
  ASSERT_EQ(act("resume", lease).status, 202);
  fly(2);
  EXPECT_FALSE(drone_->targets.empty());
  EXPECT_EQ(drone_->session.status().mode, "GUIDED");
}

TEST(AircraftJson, HasNoSilenceBeforeTheAircraftWasHeard) {
  DroneStatus status;
  status.silent_s = 20838;  // the server's own time
  EXPECT_TRUE(api::drone_json(status)["silent_s"].is_null());
  status.identity.system = 1;
  EXPECT_EQ(api::drone_json(status)["silent_s"], 20838.0);
}

TEST_F(Flights, WithoutAnAircraftToCommandThePilotIsShownWhereToGo) {
  with_drone_ = false;
  app_.reset();
  database_.reset();
  open();
  mission_ = mission();
  const auto plan = make_plan();
  fly(12);
  check_everything();
  const std::string lease = control()["lease"];
  const auto started = act("start", lease, R"(,"plan":")" + plan + '"');
  ASSERT_EQ(started.status, 202) << started.body;
  EXPECT_EQ(json(started)["state"], "accepted");
  // The pilot takes off by hand and flies to the point that is shown.
  auto& vehicle = drone_->autopilot.vehicle();
  vehicle.arm();
  vehicle.take_off(4);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "go_to_waypoint"; }, 60)) << procedure().dump(1);
  const auto target = procedure()["target"]["enu_m"];
  EXPECT_EQ(procedure()["mode"], "manual");
  vehicle.go_to(Eigen::Vector3d(target[0].get<double>(), target[1].get<double>(), target[2].get<double>()),
                std::nullopt);
  EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60)) << procedure().dump(1);
}

}  // namespace
}  // namespace anchord::test::flights_test
