// The rules of topics: sequence, resume, and what a slow client loses or keeps.
#include <gtest/gtest.h>

#include <atomic>
#include <deque>
#include <nlohmann/json.hpp>
#include <thread>

#include "api/stream/conversation.hpp"

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

TEST_F(HubRules, AStreamIsResumedWithAllThatWasMissedHoweverOftenTheHubTicked) {
  for (int i = 0; i < 5; ++i) {
    hub_.publish(Topic::ranges, R"({"n":)" + std::to_string(i) + "}", i);
    hub_.tick();
  }
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"ranges","since":{"epoch":")" + hub_.epoch() +
                  R"(","seq":2}})");
  const auto frames = read(*client);
  EXPECT_EQ(of(frames, "ack")[0]["recovered"], true);
  std::vector<int> missed;
  for (const auto& frame : of(frames, "data"))
    for (const auto& row : frame["data"]) missed.push_back(row["n"]);
  EXPECT_EQ(missed, (std::vector{2, 3, 4}));
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

TEST_F(HubRules, TakesAtMost32Subscriptions) {
  auto client = connect();
  for (int i = 0; i < 33; ++i) client->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
  const auto frames = read(*client);
  EXPECT_EQ(of(frames, "ack").size(), 32u);
  EXPECT_EQ(of(frames, "err").size(), 1u);
}

// Client 65 was not joined, yet could subscribe, and its end never left the hub: the next message went to
// freed memory. How many may come is decided where connections are accepted.
TEST_F(HubRules, TellsEveryClientThatSubscribedAndForgetsThoseThatLeft) {
  for (int round = 0; round < 2; ++round) {
    std::vector<std::unique_ptr<api::Conversation>> many;
    for (int i = 0; i < 100; ++i) {
      many.push_back(connect());
      many.back()->on_text(R"({"op":"sub","id":1,"topic":"ranges"})");
      many.back()->on_text(R"({"op":"sub","id":2,"topic":"ranges"})");
      read(*many.back());
    }
    EXPECT_EQ(hub_.clients(), 100u);
    hub_.publish(Topic::ranges, R"({"n":1})", 1);
    for (auto& client : many) EXPECT_EQ(of(read(*client), "data").size(), 2u);
    many[0]->on_text(R"({"op":"unsub","id":3,"sub":9})");
    hub_.publish(Topic::ranges, R"({"n":2})", 2);
    EXPECT_EQ(of(read(*many[0]), "data").size(), 1u) << "one of its two subscriptions is left";
    for (std::size_t i = 0; i < 50; ++i) many[i]->on_close();
    EXPECT_EQ(hub_.clients(), 50u);
    many.clear();
    EXPECT_EQ(hub_.clients(), 0u);
    hub_.publish(Topic::ranges, R"({"n":3})", 3);
    hub_.tick();
  }
}

// 2 000 clients come, subscribe, read a little and go on several threads, while others publish and tick: what
// build/asan and build/tsan are for.
TEST_F(HubRules, SurvivesTwoThousandClientsComingAndGoing) {
  std::atomic<int> woken{0}, served{0};
  std::atomic<bool> done{false};
  std::vector<std::thread> threads;
  threads.emplace_back([&] {
    for (int n = 0; !done; ++n) {
      hub_.publish(Topic::events, R"({"n":1})", n);
      hub_.collect(Topic::ranges, R"({"n":1})", n, NetworkId{0x6a2f});
      hub_.publish(Topic::drone_pose, R"({"n":1})", n, "m");
    }
  });
  threads.emplace_back([&] {
    while (!done) hub_.tick();
  });
  constexpr int k_threads = 4;
  std::vector<std::thread> visitors;
  for (int t = 0; t < k_threads; ++t) {
    visitors.emplace_back([&] {
      std::deque<std::unique_ptr<api::Conversation>> here;
      for (int i = 0; i < 2000 / k_threads; ++i) {
        here.push_back(
            std::make_unique<api::Conversation>(hub_, api::Principal{"t", "t", {api::Role::viewer}}));
        here.back()->on_open([&woken] { ++woken; });
        for (const char* topic : {"events", "ranges", "drone.pose"})
          here.back()->on_text(R"({"op":"sub","id":1,"topic":")" + std::string(topic) + "\"}");
        while (here.back()->next_frame()) ++served;
        // Most stay for a while beside each other; every other one says no goodbye.
        if (here.size() > 100) {
          if (i % 2 == 0) here.front()->on_close();
          here.pop_front();
        }
      }
    });
  }
  for (auto& visitor : visitors) visitor.join();
  done = true;
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(hub_.clients(), 0u);
  EXPECT_GT(woken, 2000);
  EXPECT_GT(served, 2000 * 3) << "hello, and an answer to every subscription";
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
