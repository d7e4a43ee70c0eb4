// A plan edited while it is flown, over REST, against the simulated autopilot through the real session: what
// is taken is flown, what cannot be taken safely is refused and the plan before flies on.
#include <algorithm>
#include <chrono>
#include <thread>

#include "core/ports/access_store.hpp"
#include "drivers/sim/wgs84.hpp"
#include "flights_fixture.hpp"

namespace anchord::test::plan_in_flight_test {
namespace {

using Eigen::Vector3d;

class PlanInFlight : public Flights {
 protected:
  static Json corner(double east_m, double north_m) {
    const auto at = sim::wgs84_from_enu({51.0231, 3.7131, 55.5}, {east_m, north_m, 0});
    return {at.lon_deg, at.lat_deg};
  }
  static Json waypoint(double east_m, double north_m, double height_m) {
    const auto at = corner(east_m, north_m);
    return {{"lon", at[0]}, {"lat", at[1]}, {"height_above_ground_m", height_m}};
  }
  static Json box(double west_m, double south_m, double east_m, double north_m) {
    return {{"type", "Polygon"},
            {"coordinates",
             {{corner(west_m, south_m), corner(east_m, south_m), corner(east_m, north_m),
               corner(west_m, north_m)}}}};
  }
  /// The stored plan with what `edit` makes of it, saved as its next revision.
  void edit(const std::function<void(Json&)>& edit) {
    const std::string path = "/api/v1/plans/" + procedure()["plan"].get<std::string>();
    const auto stored = get(path);
    Json plan = json(stored);
    edit(plan);
    Call with;
    with.headers = {{"if-match", header(stored, "ETag")}};
    const auto saved = call(api::Method::put, path, plan.dump(), with);
    ASSERT_EQ(saved.status, 200) << saved.body;
  }
  Json difference(bool undo = false) {
    const auto answer = get(base() + "/plan/change", {{"undo", undo ? "true" : "false"}});
    EXPECT_EQ(answer.status, 200) << answer.body;
    return json(answer);
  }
  api::Response take(const std::string& lease, int revision, const std::string& more = "") {
    return post(base() + "/plan",
                R"({"lease":")" + lease + R"(","revision":)" + std::to_string(revision) + more + '}');
  }
  Json events_of(const std::string& code) {
    Json out = Json::array();
    const Json all = json(get(base() + "/events"));
    for (const auto& e : all["items"])
      if (e["code"] == code) out.push_back(e);
    return out;
  }
  Vector3d at() const { return drone_->autopilot.vehicle().position_m(); }
  bool refused_with(const api::Response& answer, const std::string& words) {
    EXPECT_EQ(answer.status, 422) << answer.body;
    EXPECT_EQ(procedure()["plan_revision"], 1) << "the old one flies on";
    return answer.body.find(words) != std::string::npos;
  }
};

TEST_F(PlanInFlight, ASavedRevisionIsNotFlownUntilItIsTaken) {
  const auto lease = take_off();
  edit([](Json& plan) { plan["waypoints"].insert(plan["waypoints"].begin(), waypoint(-7, 10, 6)); });
  EXPECT_EQ(procedure()["plan_revision"], 1);
  EXPECT_EQ(procedure()["plan_saved_revision"], 2);
  ASSERT_EQ(events_of("plan.waiting").size(), 1u);
  const Json d = difference();
  EXPECT_EQ(d["takeable"], true) << d.dump(1);
  EXPECT_EQ(d["from_revision"], 1);
  EXPECT_EQ(d["to_revision"], 2);
  EXPECT_EQ(d["next_waypoint"], 1) << "it is on its way to the first: nothing is flown yet";
  ASSERT_EQ(d["waypoints"].size(), 1u);
  EXPECT_EQ(d["waypoints"][0]["change"], "added");
  EXPECT_EQ(d["waypoints"][0]["passed"], false);
  EXPECT_GT(d["forecast_after_s"]["expected"].get<double>(),
            d["forecast_before_s"]["expected"].get<double>());
  fly(1);
  EXPECT_EQ(procedure()["plan_revision"], 1) << "asking changes nothing";

  EXPECT_EQ(post(base() + "/plan", R"({"lease":"somebody else","revision":2})").status, 409);
  EXPECT_EQ(take(lease, 1).status, 422) << "another revision than the one that is saved";
  EXPECT_EQ(take(lease, 2, R"(,"next_waypoint":2)").status, 422) << "from elsewhere than a person has seen";
  const auto taken = take(lease, 2, R"(,"next_waypoint":1)");
  ASSERT_EQ(taken.status, 200) << taken.body;
  EXPECT_EQ(procedure()["plan_revision"], 2);
  EXPECT_EQ(procedure()["plan_undo_revision"], 1);
  EXPECT_EQ(procedure()["n_waypoints"], 3);
  ASSERT_EQ(events_of("procedure.plan_changed").size(), 1u);
  EXPECT_NE(events_of("procedure.plan_changed")[0]["text"].get<std::string>().find(
                "revision 2 is flown from waypoint 1 on, revision 1 before; taken by tester"),
            std::string::npos);
  EXPECT_TRUE(fly_until([&] { return (at() - Vector3d(-7, 10, 6)).norm() < 1; }, 60)) << "it flies there";
  const auto log = database_->stores().access.audit(200);
  ASSERT_TRUE(log.has_value());
  EXPECT_EQ(std::ranges::count_if(log.value(),
                                  [](const auto& e) {
                                    return e.what.starts_with("mission.plan ") &&
                                           e.what.ends_with(" revision 2");
                                  }),
            3)
      << "refused twice, taken once";
}

TEST_F(PlanInFlight, TheWaypointThatIsWorkedAtIsFinishedAndTheNextIsTheNewPlans) {
  const auto lease = take_off();
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60));
  edit([](Json& plan) {
    plan["waypoints"][0] = waypoint(-9, 4, 4);  // where it is now, moved: too late
    plan["waypoints"][1] = waypoint(-7, 24, 9);
  });
  const Json d = difference();
  EXPECT_EQ(d["next_waypoint"], 2);
  EXPECT_EQ(d["waypoints"][0]["passed"], true);
  EXPECT_EQ(d["notes"].size(), 1u) << d["notes"];
  ASSERT_EQ(take(lease, 2).status, 200);
  EXPECT_EQ(procedure()["step"], "search_anchors") << "what is begun is finished";
  EXPECT_EQ(procedure()["waypoint"], 1);
  ASSERT_EQ(act("skip", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return (at() - Vector3d(-7, 24, 9)).norm() < 1; }, 90)) << at().transpose();
  EXPECT_EQ(procedure()["waypoint"], 2);
}

TEST_F(PlanInFlight, ItIsRefusedWhereItIsNotSafeAndTheOldPlanFliesOn) {
  const auto lease = take_off();
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60));
  edit([](Json& plan) { plan["no_fly"] = Json::array({box(-9, -8, -4, -3)}); });
  EXPECT_EQ(difference()["takeable"], false);
  EXPECT_TRUE(refused_with(take(lease, 2),
                           "the aircraft would be at a position that is not allowed: over the building "
                           "or inside a no-fly area"));
  edit([](Json& plan) { plan["no_fly"] = Json::array({box(-9.5, -12.5, -8.5, -11)}); });
  EXPECT_TRUE(refused_with(take(lease, 3), "the way home would be blocked")) << take(lease, 3).body;
  edit([](Json& plan) {
    plan["no_fly"] = Json::array();
    plan["waypoints"][1] = waypoint(15, 10, 9);  // over the building
  });
  EXPECT_TRUE(refused_with(take(lease, 4), "nearer than 4.0 m")) << take(lease, 4).body;
  edit([](Json& plan) {
    plan["waypoints"][1] = waypoint(36.5, -5.6, 9);
    plan["settings"]["min_height_m"] = 8;
  });
  EXPECT_TRUE(refused_with(take(lease, 5), "m high, the height band begins at 8.0 m")) << take(lease, 5).body;
  edit([](Json& plan) {
    plan["settings"]["min_height_m"] = 1.5;
    plan["origin"]["h_m"] = 60;
  });
  EXPECT_TRUE(refused_with(take(lease, 6), "heights are measured from it"));
  const auto log = database_->stores().access.audit(200);
  EXPECT_TRUE(std::ranges::any_of(log.value(), [](const auto& e) {
    return e.what.starts_with("mission.plan ") &&
           e.result.starts_with("refused: the way home would be blocked");
  }));
  ASSERT_EQ(act("skip", lease).status, 202);
  EXPECT_TRUE(fly_until([&] { return (at() - Vector3d(36.5, -5.6, 9)).norm() < 1.5; }, 90))
      << at().transpose();
}

TEST_F(PlanInFlight, ANoFlyAreaThatIsAddedIsFlownRoundAtOnce) {
  const auto lease = take_off();
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60));
  ASSERT_EQ(act("skip", lease).status, 202);
  ASSERT_TRUE(fly_until([&] { return at().x() > -2; }, 30));
  edit([](Json& plan) { plan["no_fly"] = Json::array({box(14, -12, 18, -2)}); });
  ASSERT_EQ(take(lease, 2).status, 200);
  double nearest_m = 1e9;
  ASSERT_TRUE(fly_until(
      [&] {
        const Vector3d away(std::max({14 - at().x(), at().x() - 18, 0.0}),
                            std::max({-12 - at().y(), at().y() + 2, 0.0}), 0);
        nearest_m = std::min(nearest_m, away.norm());
        return (at() - Vector3d(36.5, -5.6, 9)).norm() < 1.5;
      },
      120))
      << at().transpose();
  EXPECT_GT(nearest_m, 3.0) << "4 m are kept, 1 m of wind and control is allowed";
}

TEST_F(PlanInFlight, UndoFliesThePlanBeforeAndCanBeUndoneItself) {
  const auto lease = take_off();
  EXPECT_EQ(get(base() + "/plan/change", {{"undo", "true"}}).status, 422) << "nothing to undo yet";
  edit([](Json& plan) { plan["waypoints"][0] = waypoint(-3, -8, 6); });
  ASSERT_EQ(take(lease, 2).status, 200);
  EXPECT_EQ(difference(true)["to_revision"], 1);
  ASSERT_EQ(take(lease, 1, R"(,"undo":true)").status, 200);
  EXPECT_EQ(procedure()["plan_revision"], 1);
  EXPECT_EQ(procedure()["plan_undo_revision"], 2);
  EXPECT_EQ(procedure()["plan_changes"], 2);
  EXPECT_TRUE(fly_until([&] { return (at() - Vector3d(-7, -5.6, 4)).norm() < 1; }, 60)) << at().transpose();
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 20));
  EXPECT_EQ(take(lease, 2, R"(,"undo":true)").status, 200);
  EXPECT_EQ(json(get(base() + "/plan"))["plan"]["waypoints"].size(), 2u);
  EXPECT_EQ(json(get(base() + "/plan"))["changes"], 3);
  EXPECT_EQ(json(get(base() + "/plan"))["changed_by"], "tester");
}

TEST_F(PlanInFlight, OtherTargetsAndAnchorsCountAtOnce) {
  const auto lease = take_off();
  edit([](Json& plan) {
    plan["settings"]["target_sigma_m"] = 0.02;
    plan["expected_anchors"] = {"0x6a21"};
    plan["anchor_targets"] = {{{"network_id", "0x6a21"}, {"target_sigma_m", 0.015}}};
  });
  const Json d = difference();
  ASSERT_EQ(d["settings"].size(), 1u) << d["settings"];
  EXPECT_EQ(d["settings"][0]["name"], "target_sigma_m");
  EXPECT_EQ(d["settings"][0]["after"], 0.02);
  EXPECT_EQ(d["anchors_added"], Json::array({"0x6a21"}));
  EXPECT_EQ(d["anchor_targets"], Json::parse(R"([{"network_id":"0x6a21","before":null,"after":0.015}])"));
  ASSERT_EQ(take(lease, 2).status, 200);
  EXPECT_EQ(procedure()["target_sigma_m"], 0.02);
  const double end_s = drone_->now + 60;
  while (procedure()["anchors"].empty() && drone_->now < end_s) measure(1);
  const Json now = procedure();
  for (const auto& task : now["anchors"])
    EXPECT_EQ(task["target_sigma_m"], task["network_id"] == "0x6a21" ? 0.015 : 0.02) << task;
}

TEST_F(PlanInFlight, APersonEndsTheWorkOnAnAnchorAndTakesThatBack) {
  const auto lease = take_off();
  const auto order = [&](const std::string& action, const std::string& anchor, const std::string& key) {
    return post(base() + "/anchors/" + anchor + "/work",
                R"({"action":")" + action + R"(","lease":")" + key + R"("})");
  };
  const auto ordered = [&](const std::string& action) { return order(action, "0x6a21", lease); };
  const auto task = [&] { return procedure()["anchors"][0]; };
  EXPECT_EQ(ordered("accept").status, 422) << "nothing of it has come";
  EXPECT_EQ(ordered("give_up").status, 422);
  EXPECT_EQ(order("give_up", "anchor", lease).status, 422);
  EXPECT_EQ(ordered("like").status, 422);

  const double end_s = drone_->now + 60;
  while (ordered("give_up").status != 204 && drone_->now < end_s) measure(1);
  measure(5);
  EXPECT_EQ(task()["done"], true);
  EXPECT_EQ(task()["reached"], false);
  EXPECT_EQ(task()["accepted"], false);
  EXPECT_EQ(task()["ended_by"], "tester");
  const auto early = ordered("accept");
  EXPECT_EQ(early.status, 422) << "seen from one place alone it may be anywhere round it";
  EXPECT_NE(early.body.find("its position may be far off"), std::string::npos) << early.body;
  EXPECT_EQ(order("reopen", "0x6a21", "somebody else").status, 409);
  ASSERT_EQ(ordered("reopen").status, 204);
  EXPECT_EQ(task()["done"], false);
  EXPECT_TRUE(task()["ended_by"].is_null());
  EXPECT_EQ(ordered("reopen").status, 422) << "nothing to take back";
  EXPECT_EQ(events_of("anchor.given_up").size(), 1u);
  EXPECT_EQ(events_of("anchor.reopened").size(), 1u);

  fly(0.5);
  app_.reset();
  database_.reset();
  open();
  fly(0.5);
  EXPECT_EQ(task()["done"], false) << "kept over a restart";
  const auto again = control()["lease"].get<std::string>();
  const auto given_up = order("give_up", "0x6a21", again);
  ASSERT_EQ(given_up.status, 204) << given_up.body;
  fly(0.5);
  app_.reset();
  database_.reset();
  open();
  fly(0.5);
  EXPECT_EQ(task()["ended_by"], "tester");
}

TEST_F(PlanInFlight, AnAnchorWhosePositionIsDeterminedIsAcceptedBeforeItsAccuracyIsReached) {
  const auto lease = take_off();
  const auto accept = [&] {
    return post(base() + "/anchors/0x6a21/work", R"({"action":"accept","lease":")" + lease + R"("})");
  };
  edit([](Json& plan) {
    plan["waypoints"] = {waypoint(-7, 10, 4), waypoint(-7, 27, 9), waypoint(15, 27, 3), waypoint(37, 27, 9)};
    plan["settings"]["target_sigma_m"] = 0.005;
  });
  ASSERT_EQ(take(lease, 2).status, 200) << "round the building";
  api::Response answer;
  const double end_s = drone_->now + 600;
  while (answer.status != 204 && drone_->now < end_s) {
    measure(2);
    // The solver has a strand of its own: as much of its time as it needs for so many ranges.
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
    while ((answer = accept()).status != 204 && std::chrono::steady_clock::now() < until)
      std::this_thread::yield();
  }
  ASSERT_EQ(answer.status, 204) << answer.body;
  const Json task = procedure()["anchors"][0];
  EXPECT_EQ(task["done"], true);
  EXPECT_EQ(task["accepted"], true);
  EXPECT_EQ(task["reached"], false) << "the accuracy that was wanted is not there";
  EXPECT_EQ(task["weight"], 0.0) << "nothing more is flown for it";
  EXPECT_EQ(events_of("anchor.accepted").size(), 1u);
}

TEST_F(PlanInFlight, TheFenceThatTheAutopilotKeepsIsNotChangedInTheAir) {
  mission_ = mission();
  const auto plan = make_plan(R"("fence":)" + box(-40, -40, 70, 60).dump() + ',');
  const auto up = [&] {
    const Json list = json(get(base() + "/checklist", {{"plan", plan}}));
    return std::ranges::any_of(list["items"],
                               [](const Json& i) { return i["id"] == "fence" && i["state"] == "ok"; });
  };
  const std::string lease = control()["lease"];
  ASSERT_EQ(post(base() + "/checklist", R"({"plan":")" + plan + R"("})").status, 200);
  ASSERT_TRUE(fly_until(up, 60));
  fly(12);
  check_everything();
  ASSERT_EQ(act("start", lease, R"(,"plan":")" + plan + '"').status, 202);
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "go_to_waypoint"; }, 60));
  edit([](Json& p) { p["fence"] = box(-40, -40, 80, 60); });
  EXPECT_TRUE(refused_with(take(lease, 2), "the autopilot keeps the fence"));
}

TEST_F(PlanInFlight, AChangeOutlivesTheServer) {
  const auto lease = take_off();
  ASSERT_TRUE(fly_until([&] { return procedure()["step"] == "search_anchors"; }, 60));
  edit([](Json& plan) {
    plan["waypoints"] = {waypoint(-7, 24, 9), waypoint(-7, 10, 6)};  // of what was flown nothing is left
  });
  ASSERT_EQ(take(lease, 2).status, 200);
  fly(0.5);
  const Json before = procedure();
  app_.reset();
  database_.reset();
  open();
  fly(0.5);
  const Json after = procedure();
  EXPECT_EQ(after["plan_revision"], 2);
  EXPECT_EQ(after["plan_undo_revision"], 1);
  EXPECT_EQ(after["n_waypoints"], before["n_waypoints"]);
  EXPECT_EQ(after["status"], "hold");
  const std::string again = control(R"({"action":"take","force":true})")["lease"];
  EXPECT_EQ(difference(true)["to_revision"], 1);
  ASSERT_EQ(act("skip", again).status, 202);
  EXPECT_TRUE(fly_until([&] { return (at() - Vector3d(-7, 24, 9)).norm() < 1; }, 90)) << at().transpose();
}

TEST_F(PlanInFlight, WhatIsNotFlownCannotBeChanged) {
  mission_ = mission();
  make_plan();
  EXPECT_EQ(get(base() + "/plan").status, 404);
  EXPECT_EQ(get(base() + "/plan/change").status, 422);
  const std::string lease = control()["lease"];
  EXPECT_EQ(take(lease, 1).status, 422);
}

}  // namespace
}  // namespace anchord::test::plan_in_flight_test
