// The rules of topics: sequence, resume, and what a slow client loses or keeps.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "api/live/conversation.hpp"

namespace anchord::test {
namespace {

using Json = nlohmann::json;
using api::Topic;

class HubRules : public ::testing::Test {
 protected:
  std::unique_ptr<api::Conversation> connect() {
    auto client = std::make_unique<api::Conversation>(hub_, api::Principal{"t", "t", {api::Role::viewer}});
    client->on_open([] {});
    return client;
  }
  static std::vector<Json> read(api::WsHandler& client) {
    std::vector<Json> frames;
    while (auto frame = client.next_frame()) frames.push_back(Json::parse(*frame));
    return frames;
  }
  static std::vector<Json> of(const std::vector<Json>& frames, const std::string& op) {
    std::vector<Json> out;
    for (const auto& frame : frames) {
      if (frame["op"] == op) out.push_back(frame);
    }
    return out;
  }
  SystemClock clock_;
  api::Hub hub_{clock_, "anchord test"};
};

TEST_F(HubRules, GreetsThenAnswersASubscriptionWithAckAndSnap) {
  hub_.publish(Topic::drone_pose, R"({"mission":"m"})", 1, "m");
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"drone.pose"})");
  const auto frames = read(*client);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[0]["op"], "hello");
  EXPECT_EQ(frames[1]["op"], "ack");
  EXPECT_EQ(frames[1]["recovered"], false);
  EXPECT_EQ(frames[2]["data"][0]["mission"], "m");
}

TEST_F(HubRules, KeepsOnlyTheNewestStatePerKeyForASlowClient) {
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"anchors.estimates"})");
  read(*client);
  for (int i = 0; i < 1000; ++i)
    hub_.publish(Topic::anchors_estimates, R"({"n":)" + std::to_string(i) + "}", i, i % 2 == 0 ? "a" : "b");
  const auto data = of(read(*client), "data");
  ASSERT_EQ(data.size(), 1u);
  EXPECT_EQ(data[0]["data"].size(), 2u);
  EXPECT_EQ(data[0]["conflated"], 998);
  EXPECT_EQ(data[0]["prev"], 0);
  EXPECT_EQ(data[0]["seq"], 1000);
}

TEST_F(HubRules, DropsTheOldestOfAStreamAndSaysSoWithoutHoles) {
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
  read(*client);
  for (int i = 0; i < 2000; ++i) hub_.publish(Topic::ranges, R"({"n":)" + std::to_string(i) + "}", i);
  const auto frames = read(*client);
  const auto gaps = of(frames, "gap"), data = of(frames, "data");
  ASSERT_EQ(gaps.size(), 1u);
  EXPECT_EQ(gaps[0]["from_seq"], 1);
  EXPECT_EQ(gaps[0]["dropped"].get<int>(), 2000 - 512);
  EXPECT_EQ(data.front()["prev"], gaps[0]["to_seq"]);
  EXPECT_EQ(data.back()["seq"], 2000);
  EXPECT_FALSE(client->close_request().has_value());
}

TEST_F(HubRules, ClosesAClientThatCannotKeepUpWithEventsAndLetsItResume) {
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"events"})");
  read(*client);
  for (int i = 0; i < 600; ++i) hub_.publish(Topic::events, R"({"n":)" + std::to_string(i) + "}", i);
  ASSERT_TRUE(client->close_request().has_value());
  EXPECT_EQ(client->close_request()->first, 4008);
  auto again = connect();
  again->on_text(R"({"op":"sub","id":1,"topic":"events","since":{"epoch":")" + hub_.epoch() +
                 R"(","seq":0}})");
  const auto frames = read(*again);
  EXPECT_EQ(of(frames, "ack")[0]["recovered"], true);
  int n = 0;
  for (const auto& frame : of(frames, "data")) {
    for (const auto& event : frame["data"]) EXPECT_EQ(event["n"], n++);
  }
  EXPECT_EQ(n, 600);
}

TEST_F(HubRules, GivesASnapWhenTheEpochIsAnother) {
  hub_.publish(Topic::events, R"({"n":1})", 1);
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"events","since":{"epoch":"other","seq":0}})");
  const auto frames = read(*client);
  EXPECT_EQ(of(frames, "ack")[0]["recovered"], false);
  EXPECT_EQ(of(frames, "snap")[0]["data"].size(), 1u);
}

TEST_F(HubRules, DoesNotLetASlowClientDisturbAnother) {
  auto slow = connect(), quick = connect();
  slow->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
  quick->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
  read(*quick);
  for (int i = 1; i <= 3000; ++i) {
    hub_.publish(Topic::ranges, "{}", i);
    const auto frames = read(*quick);
    ASSERT_EQ(frames.size(), 1u);
    ASSERT_EQ(frames[0]["prev"], i - 1);
  }
}

TEST_F(HubRules, SharesTheBytesOfAFrameAmongClients) {
  auto one = connect(), two = connect();
  for (auto* client : {one.get(), two.get()}) {
    client->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
    read(*client);
  }
  hub_.publish(Topic::ranges, "{}", 1);
  EXPECT_EQ(one->next_frame().get(), two->next_frame().get());
}

TEST_F(HubRules, FiltersByAnchorAndRefusesNonsense) {
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"ranges","params":{"anchors":["0x6a2f"]}})");
  client->on_text(R"({"op":"sub","id":2,"topic":"nothing"})");
  client->on_text(R"({"op":"sub","id":3,"topic":"ranges","params":{"max_hs":2}})");
  EXPECT_EQ(of(read(*client), "err").size(), 2u);
  hub_.publish(Topic::ranges, R"({"a":1})", 1, {}, NetworkId{0x6a2f});
  hub_.publish(Topic::ranges, R"({"a":2})", 2, {}, NetworkId{0x1111});
  const auto data = of(read(*client), "data");
  ASSERT_EQ(data.size(), 1u);
  EXPECT_EQ(data[0]["data"].size(), 1u);
  client->on_text("{nonsense");
  EXPECT_EQ(client->close_request()->first, 4009);
}

TEST_F(HubRules, TakesAtMost32SubscriptionsAnd64Connections) {
  auto client = connect();
  for (int i = 0; i < 33; ++i) client->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
  const auto frames = read(*client);
  EXPECT_EQ(of(frames, "ack").size(), 32u);
  EXPECT_EQ(of(frames, "err").size(), 1u);
  std::vector<std::unique_ptr<api::Conversation>> many;
  for (int i = 0; i < 64; ++i) many.push_back(connect());
  EXPECT_EQ(many.back()->close_request()->first, 4029);
}

TEST_F(HubRules, TellsTheTimeAndSaysGoodbye) {
  auto client = connect();
  client->on_text(R"({"op":"time","id":9,"c_us":5})");
  EXPECT_EQ(of(read(*client), "time")[0]["c_us"], 5);
  hub_.tick();
  EXPECT_EQ(of(read(*client), "hb").size(), 1u);
  hub_.shut_down();
  EXPECT_EQ(of(read(*client), "bye")[0]["code"], 4010);
  EXPECT_EQ(client->close_request()->first, 4010);
}

TEST_F(HubRules, SaysGoodbyeToWhomComesWhileItShutsDown) {
  hub_.shut_down();
  auto client = connect();
  ASSERT_TRUE(client->close_request());
  EXPECT_EQ(client->close_request()->first, 4010);
}

}  // namespace
}  // namespace anchord::test
