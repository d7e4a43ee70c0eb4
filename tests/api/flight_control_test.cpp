// Who has control of the aircraft, over REST: taken by one alone, asked for, taken by force, ended with its
// token.
#include <algorithm>
#include <thread>
#include <vector>

#include "core/ports/access_store.hpp"
#include "flights_fixture.hpp"

namespace anchord::test::flight_control_test {
namespace {

TEST_F(Flights, OneOfEightTakesControl) {
  mission_ = mission();
  std::vector<int> status(8);
  {
    std::vector<std::jthread> threads;
    for (auto& one : status)
      threads.emplace_back([&] { one = post(base() + "/control", R"({"action":"take"})").status; });
  }
  EXPECT_EQ(std::ranges::count(status, 200), 1) << ::testing::PrintToString(status);
  EXPECT_EQ(std::ranges::count(status, 409), 7) << ::testing::PrintToString(status);
}

TEST_F(Flights, ALeaseOnAMissionThatIsNotFlownBlocksNoOther) {
  mission_ = mission();
  control();
  const auto yesterdays = mission_;
  mission_ = mission();
  ASSERT_NE(mission_, yesterdays);
  EXPECT_EQ(post(base() + "/control", R"({"action":"take"})").status, 200);
  EXPECT_EQ(post(base() + "/control", R"({"action":"take"})").status, 409) << "on its own mission it holds";
}

TEST_F(Flights, AskingForControlReachesItsHolderAndTakesNothing) {
  mission_ = mission();
  EXPECT_EQ(post(base() + "/control", R"({"action":"ask"})").status, 409) << "nobody has it: it can be taken";
  const auto lease = take_off();
  const auto asked = control(R"({"action":"ask"})");
  EXPECT_EQ(asked["held"], true);
  EXPECT_FALSE(asked.contains("lease")) << "asking is not having";
  EXPECT_EQ(act("hold", lease).status, 202) << "the holder still has it";
  EXPECT_EQ(post(base() + "/control", R"({"action":"refuse","lease":"another"})").status, 409);
  EXPECT_EQ(control(R"({"action":"refuse","lease":")" + lease + "\"}")["lease"], lease);
  std::vector<std::string> codes;
  const Json events = json(get(base() + "/events", {{"limit", "100"}}));
  for (const auto& event : events["items"]) codes.push_back(event["code"]);
  EXPECT_EQ(std::ranges::count(codes, "control.asked"), 1);
  EXPECT_EQ(std::ranges::count(codes, "control.refused"), 1);
}

TEST_F(Flights, ControlEndsWithItsToken) {
  const auto lease = take_off();
  const auto made =
      access_->create_token("second crew", {"operator"}, std::nullopt, {"tester", "tester", {}}, "");
  ASSERT_TRUE(made);
  Call crew;
  crew.token = to_string(made.value().token.id);
  crew.roles = {api::Role::op};
  ASSERT_EQ(call(api::Method::post, base() + "/control", R"({"action":"take","force":true})", crew).status,
            200);
  fly(1);
  EXPECT_EQ(post(base() + "/control", R"({"action":"take"})").status, 409) << "its token lives";
  ASSERT_TRUE(access_->revoke_token(made.value().token.id, {"tester", "tester", {}}, ""));
  fly(0.5);
  EXPECT_EQ(json(get(base() + "/control"))["held"], false);
  EXPECT_EQ(post(base() + "/control", R"({"action":"take"})").status, 200) << "without force";
  EXPECT_EQ(procedure()["status"], "running");
  const Json events = json(get(base() + "/events", {{"limit", "100"}}));
  EXPECT_EQ(
      std::ranges::count_if(events["items"], [](const Json& e) { return e["code"] == "control.ended"; }), 1);
}

TEST_F(Flights, OnlyOneHasControl) {
  const auto lease = take_off();
  EXPECT_EQ(post(base() + "/control", R"({"action":"take"})").status, 409);
  EXPECT_EQ(act("hold", "0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f").status, 409);
  EXPECT_EQ(act("hold", "").status, 409);
  EXPECT_EQ(json(act("hold", "")).value("type", ""), "/problems/no-control");
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(
      call(api::Method::post, base() + "/actions", R"({"action":"hold","lease":")" + lease + "\"}", viewer)
          .status,
      403);
  EXPECT_EQ(procedure()["status"], "running");
  const std::string second = control(R"({"action":"take","force":true})")["lease"];
  EXPECT_EQ(act("hold", lease).status, 409) << "the first one lost it";
  EXPECT_EQ(act("hold", second).status, 202);
  EXPECT_EQ(control(R"({"action":"release","lease":")" + second + "\"}")["held"], false);
  EXPECT_EQ(json(get(base() + "/control"))["held"], false);
  const auto audit = database_->stores().access.audit(100);
  ASSERT_TRUE(audit);
  int refused = 0, done = 0;
  for (const auto& entry : audit.value()) {
    refused += entry.what.rfind("mission.hold", 0) == 0 && entry.result != "ok";
    done += entry.what.rfind("mission.hold", 0) == 0 && entry.result == "ok";
  }
  EXPECT_EQ(done, 1);
  EXPECT_EQ(refused, 4);
}

}  // namespace
}  // namespace anchord::test::flight_control_test
