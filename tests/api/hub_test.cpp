// The rules of topics: sequence, resume, and what a slow client loses or keeps.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "api/stream/conversation.hpp"
#include "api/stream/delta.hpp"

namespace anchord::test::hub_test {
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

/// One client's outbox, its time given with each call.
class OutboxRules : public ::testing::Test {
 protected:
  void subscribe(Topic topic, const std::function<void(api::Subscription&)>& how) {
    topic_ = topic;
    api::Subscription subscription;
    subscription.id = api::default_sub(topic);
    subscription.topic = topic;
    how(subscription);
    outbox_.add(subscription);
    outbox_.start(subscription.id, 0, {}, shown_);
  }
  void put(double now_s, const std::string& json, const std::string& key = {}) {
    auto message = std::make_shared<api::LiveMessage>();
    message->seq = ++seq_;
    message->elements.push_back({key, {}, std::make_shared<const std::string>(json)});
    EXPECT_TRUE(outbox_.put(message, topic_, us(now_s)));
  }
  static std::string estimate(const char* anchor, int h_m, const char* status) {
    return R"({"mission":"m","anchor":")" + std::string(anchor) + R"(","status":")" + status + R"(","h_m":)" +
           std::to_string(h_m) + "}";
  }
  std::vector<Json> read(double now_s) {
    std::vector<Json> frames;
    while (auto frame = outbox_.next(us(now_s))) frames.push_back(Json::parse(*frame));
    return frames;
  }
  static std::int64_t us(double s) { return static_cast<std::int64_t>(s * 1e6); }

  api::HubCounters counters_;
  api::Outbox outbox_{counters_};
  std::vector<api::LiveElement> shown_;
  Topic topic_{};
  std::uint64_t seq_{0};
};

TEST_F(OutboxRules, SendsOnlyWhatChangedToWhomAsksForDeltasAtMostTwiceASecond) {
  shown_.push_back({"a", {}, std::make_shared<const std::string>(estimate("a", 1, "found"))});
  subscribe(Topic::anchors_estimates, [](auto& s) { s.deltas = true, s.min_interval_us = 500'000; });
  put(10, estimate("a", 2, "found"), "a");
  auto data = read(10);
  ASSERT_EQ(data.size(), 1u);
  EXPECT_EQ(data[0]["data"], Json::parse(R"({"mission":"m","anchor":"a","h_m":2})"));
  for (int i = 0; i < 20; ++i) put(10 + i * 0.02, estimate("a", 3 + i, "converged"), "a");
  put(10.45, estimate("b", 7, "found"), "b");
  EXPECT_TRUE(read(10.49).empty()) << "half a second is not over";
  data = read(10.5);
  ASSERT_EQ(data.size(), 1u);
  EXPECT_EQ(data[0]["data"], Json::parse(R"([{"mission":"m","anchor":"a","status":"converged","h_m":22},
                                             {"mission":"m","anchor":"b","status":"found","h_m":7}])"))
      << "merged, the newest of each; of one that the client has not, all";
  outbox_.heartbeat(0);
  EXPECT_EQ(read(10.6)[0]["conflating"], false) << "who asked for less is not slow";
}

TEST_F(OutboxRules, HoldsDeltasOfFiftyAnchorsTo30KilobytesASecondWithTheNewestOfEach) {
  subscribe(Topic::anchors_estimates, [](auto& s) { s.deltas = true, s.min_interval_us = 500'000; });
  std::size_t bytes = 0;
  std::map<std::string, int> has;
  for (int step = 0; step < 1000; ++step) {  // 100 estimates a second for ten seconds, of 700 bytes each
    const double now_s = step * 0.01;
    const auto anchor = std::to_string(step % 50);
    put(now_s,
        R"({"mission":"m","anchor":")" + anchor + R"(","n":)" + std::to_string(step) + R"(,"x":")" +
            std::string(650, static_cast<char>('a' + step % 26)) + R"("})",
        anchor);
    while (auto frame = outbox_.next(us(now_s))) {
      bytes += frame->size();
      Json rows = Json::parse(*frame)["data"];
      if (!rows.is_array()) rows = Json::array({rows});
      for (const auto& row : rows) has[row["anchor"]] = row["n"];
    }
  }
  EXPECT_LT(bytes, 330'000u);
  for (const auto& [anchor, n] : has) EXPECT_GT(n, 1000 - 300) << anchor << " is older than three seconds";
}

TEST_F(OutboxRules, GivesWhoAsksForNoOldStreamTheNewestAndTellsOfTheGap) {
  subscribe(Topic::ranges, [](auto& s) { s.max_age_us = 1'000'000; });
  for (int i = 0; i < 3; ++i) put(10, R"({"n":)" + std::to_string(i) + "}");
  put(11.5, R"({"n":3})");
  const auto frames = read(11.6);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0]["op"], "gap");
  EXPECT_EQ(frames[0]["dropped"], 3);
  EXPECT_EQ(frames[1]["data"][0]["n"], 3);
  EXPECT_EQ(frames[1]["prev"], frames[0]["to_seq"]);
}

TEST_F(OutboxRules, HoldsNewsFromAClientThatLagsBehindAndThenSendsTheNewest) {
  subscribe(Topic::drone_pose, [](auto&) {});
  put(10, R"({"n":0})", "m");
  ASSERT_EQ(read(10).size(), 1u);
  EXPECT_TRUE(outbox_.seen(1, us(10.1)));
  put(10.1, R"({"n":1})", "m");
  ASSERT_EQ(read(10.1).size(), 1u);
  EXPECT_TRUE(outbox_.seen(2, us(10.16))) << "the quickest report takes 0.06 s";
  for (int i = 2; i < 20; ++i) {
    put(11 + i * 0.1, R"({"n":)" + std::to_string(i) + "}", "m");
    read(11 + i * 0.1);
  }
  outbox_.heartbeat(0);
  const auto held = read(13);
  ASSERT_EQ(held.size(), 1u) << "a client that reads nothing gets heartbeats alone";
  EXPECT_EQ(held[0]["op"], "hb");
  EXPECT_EQ(held[0]["conflating"], true);
  EXPECT_FALSE(outbox_.due(us(13)));
  // 11.2, 11.3, 11.4 and 11.5 s left before the first of them was 0.31 s unread; then the heartbeat.
  EXPECT_TRUE(outbox_.seen(7, us(13.1)));
  EXPECT_TRUE(outbox_.due(us(13.1)));
  const auto data = read(13.1);
  ASSERT_EQ(data.size(), 1u);
  EXPECT_EQ(data[0]["data"]["n"], 19);
  EXPECT_FALSE(outbox_.seen(99, us(13.2))) << "it was sent eight frames";
}

TEST_F(OutboxRules, LagIsCountedBeyondTheWayAndNeverForWhoReportsNothing) {
  subscribe(Topic::drone_pose, [](auto&) {});
  std::size_t sent = 0;
  for (int i = 0; i < 100; ++i) {  // a way of 0.6 s there and back, ten frames a second
    const double now_s = 10 + i * 0.1;
    put(now_s, R"({"n":)" + std::to_string(i) + "}", "m");
    if (i >= 6) {
      ASSERT_TRUE(outbox_.seen(static_cast<std::uint64_t>(i - 5), us(now_s)));
    }
    sent += read(now_s).size();
  }
  EXPECT_EQ(sent, 100u) << "a long way is not a slow reader";
  api::HubCounters counters;
  api::Outbox silent{counters};
  api::Subscription subscription;
  subscription.id = api::default_sub(Topic::drone_pose);
  subscription.topic = Topic::drone_pose;
  silent.add(subscription);
  silent.start(subscription.id, 0, {}, {});
  for (int i = 1; i < 100; ++i) {
    auto message = std::make_shared<api::LiveMessage>();
    message->seq = static_cast<std::uint64_t>(i);
    message->elements.push_back({"m", {}, std::make_shared<const std::string>("{}")});
    EXPECT_TRUE(silent.put(message, Topic::drone_pose, us(i)));
    EXPECT_NE(silent.next(us(i)), nullptr);
  }
}

// A page on a weak machine: seventy frames a second would come, it works through twelve.
TEST_F(OutboxRules, AClientThatReadsTwelveFramesASecondIsNearTheNewestInEveryTopic) {
  const std::vector<Topic> topics{Topic::drone_pose, Topic::rtk_status, Topic::devices, Topic::ranges};
  for (const Topic topic : topics) subscribe(topic, [](auto& s) { s.max_age_us = 1'000'000; });
  std::deque<Json> unread;
  std::map<std::uint64_t, std::vector<double>> ages_s;
  std::uint64_t n_read = 0;
  for (int step = 0; step < 2000; ++step) {  // 20 s
    const double now_s = 10 + step * 0.01;
    for (std::size_t i = 0; i < topics.size(); ++i) {
      if (step % 6 != static_cast<int>(i)) continue;
      topic_ = topics[i];
      put(now_s, R"({"at":)" + std::to_string(now_s) + "}", "m");
    }
    for (auto& frame : read(now_s)) unread.push_back(std::move(frame));
    // The first second at full speed, so that the server knows how long the way is.
    for (bool once = step % 8 == 0; !unread.empty() && (step < 100 || once); once = false) {
      const Json frame = std::move(unread.front());
      unread.pop_front();
      ASSERT_TRUE(outbox_.seen(++n_read, us(now_s + 0.005)));
      if (now_s < 15 || frame["op"] != "data") continue;
      const Json& newest = frame["data"].is_array() ? frame["data"].back() : frame["data"];
      ages_s[frame["sub"]].push_back(now_s - newest["at"].get<double>());
    }
  }
  ASSERT_EQ(ages_s.size(), topics.size()) << "no topic is left out";
  for (auto& [sub, ages] : ages_s) {
    EXPECT_GT(ages.size(), 20u) << sub << ": at least once a second";
    EXPECT_LT(*std::ranges::max_element(ages), 1.0) << sub;
  }
}

TEST_F(HubRules, RefusesToHaveSentWhatItDidNot) {
  auto client = connect();
  EXPECT_EQ(read(*client).size(), 1u);
  client->on_text(R"({"op":"seen","frames":1})");
  EXPECT_TRUE(read(*client).empty()) << "no answer where all is well";
  client->on_text(R"({"op":"seen","frames":5})");
  client->on_text(R"({"op":"seen"})");
  EXPECT_EQ(of(read(*client), "err").size(), 2u);
  EXPECT_FALSE(client->close_request().has_value());
}

TEST_F(OutboxRules, SendsNothingOfASubscriptionBeforeItIsKnownWhereItBegins) {
  api::Subscription subscription;
  subscription.id = 7;
  subscription.topic = topic_ = Topic::drone_pose;
  outbox_.add(subscription);
  put(10, R"({"n":1})", "m");
  EXPECT_TRUE(read(10).empty());
  outbox_.start(7, 0, {}, {});
  EXPECT_EQ(read(10).size(), 1u);
}

TEST_F(HubRules, HasDeltasOfEstimatesAlone) {
  auto client = connect();
  client->on_text(R"({"op":"sub","id":1,"topic":"ranges","params":{"deltas":true}})");
  client->on_text(R"({"op":"sub","id":2,"topic":"anchors.estimates","params":{"deltas":true,"max_hz":2}})");
  const auto frames = read(*client);
  EXPECT_EQ(of(frames, "err").size(), 1u);
  EXPECT_EQ(of(frames, "ack").size(), 1u);
}

TEST(Delta, IsWhatDiffersAndNamesWhatIsGone) {
  const std::array<std::string_view, 1> id{"id"};
  EXPECT_EQ(
      api::delta_of(R"({"id":1,"a":2,"b":"x,}\"","c":[1,2]})", R"({"id":1,"a":3,"b":"x,}\"","d":null})", id),
      R"({"id":1,"a":3,"d":null,"c":null})");
  EXPECT_EQ(api::delta_of(R"({"p":{"x":1,"y":2},"q":null})", R"({"p":{"x":1,"y":3},"q":{"z":1}})", {}),
            R"({"p":{"y":3},"q":{"z":1}})");
  EXPECT_EQ(api::delta_of(R"({"g":[{"n":"a","v":1},{"n":"b","v":2}]})",
                          R"({"g":[{"n":"a","v":1},{"n":"b","v":5}]})", {}),
            R"({"g":{"1":{"v":5}}})");
  EXPECT_EQ(api::delta_of(R"({"g":[{"v":1}]})", R"({"g":[{"v":1},{"v":2}]})", {}),
            R"({"g":[{"v":1},{"v":2}]})")
      << "another number of them: all";
  EXPECT_EQ(api::delta_of(R"({"g":[1,2]})", R"({"g":[1,3]})", {}), R"({"g":[1,3]})");
  EXPECT_EQ(api::delta_of(R"({"a":1})", R"({"a":1})", {}), "{}");
  for (const char* broken : {"", "{", R"({"a)", R"({"a")", R"({"a":)", R"({"a":1)", "7", R"({"a":[1})"})
    EXPECT_EQ(api::delta_of(broken, R"({"a":2})", {}), R"({"a":2})") << broken;
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
      hub_.collect(Topic::ranges, R"({"n":1})", n, MissionId{}, NetworkId{0x6a2f});
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
}  // namespace anchord::test::hub_test
