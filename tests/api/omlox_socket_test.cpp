// The WebSocket of an omlox hub: wrapper objects and codes as chapter 13 of hub API 2.0.0 has them.
#include <set>

#include "omlox_fixture.hpp"

namespace anchord::test::omlox_socket_test {
namespace {

class OmloxSocket : public OmloxFixture {
 protected:
  /// Token "good" sees all, "of a site" what is of site_.
  std::unique_ptr<api::WsHandler> connect(std::function<bool()> holds = {}) {
    auto client = app_->omlox_ws_factory()({std::move(holds), {}}, [this](std::string_view token) {
      const auto stands = [this] { return holds_.load(); };
      if (token == "good") return api::Listener{stands, {}};
      if (token == "of a site")
        return api::Listener{stands, SiteSet::only({SiteId{parse_uuid(site_).value()}})};
      return api::Listener{};
    });
    client->on_open([] {});
    return client;
  }
  static std::vector<Json> read(api::WsHandler& client) {
    std::vector<Json> out;
    while (auto frame = client.next_frame()) out.push_back(Json::parse(*frame));
    return out;
  }
  static Json ask(api::WsHandler& client, const Json& message) {
    client.on_text(message.dump());
    const auto answers = read(client);
    EXPECT_EQ(answers.size(), 1U) << message;
    return answers.empty() ? Json() : answers.front();
  }
  static Json subscribe(const std::string& topic, Json params = Json::object()) {
    params["token"] = "good";
    return {{"event", "subscribe"}, {"topic", topic}, {"params", std::move(params)}};
  }
  /// The flight is known once it was looked up: here by the REST face.
  void known() { get("/omlox/v2/providers/locations"); }
  std::atomic<bool> holds_{true};
  std::string site_;
};

TEST_F(OmloxSocket, ASubscriptionGetsLocationsUntilItEnds) {
  const auto id = flight();
  fly(id);
  known();
  auto client = connect();
  const Json answer = ask(*client, subscribe("location_updates"));
  EXPECT_EQ(answer["event"], "subscribed");
  EXPECT_EQ(answer["topic"], "location_updates");
  ASSERT_TRUE(answer["subscription_id"].is_number_integer());
  fly(id);
  auto got = read(*client);
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got[0]["event"], "message");
  EXPECT_EQ(got[0]["topic"], "location_updates");
  EXPECT_EQ(got[0]["subscription_id"], answer["subscription_id"]);
  ASSERT_EQ(got[0]["payload"].size(), 1U);
  const Json& location = got[0]["payload"][0];
  for (const char* key : {"position", "source", "provider_type", "provider_id"})
    EXPECT_TRUE(location.contains(key)) << key << " is required";
  EXPECT_EQ(location["crs"], "EPSG:4326");
  EXPECT_EQ(location["provider_id"], "0x6e01");
  const Json ended = ask(*client, {{"event", "unsubscribe"}, {"subscription_id", answer["subscription_id"]}});
  EXPECT_EQ(ended["event"], "unsubscribed");
  EXPECT_EQ(ended["subscription_id"], answer["subscription_id"]);
  fly(id);
  EXPECT_TRUE(read(*client).empty());
  client->on_close();
}

TEST_F(OmloxSocket, GeoJsonIsACollectionAndFiltersSelect) {
  const auto id = flight();
  fly(id);
  known();
  auto client = connect();
  const Json geojson = ask(*client, subscribe("location_updates:geojson"));
  ask(*client, subscribe("location_updates", {{"provider_id", "0x0001"}}));
  ask(*client, subscribe("location_updates", {{"accuracy", 0.01}}));
  const Json near =
      ask(*client, subscribe("location_updates", {{"accuracy", 0.1}, {"provider_type", "uwb"}}));
  fly(id);
  const auto got = read(*client);
  ASSERT_EQ(got.size(), 2U) << "those that fit: one sigma is 5 cm";
  EXPECT_EQ(got[0]["subscription_id"], geojson["subscription_id"]);
  const Json& collection = got[0]["payload"][0];
  EXPECT_EQ(collection["type"], "FeatureCollection");
  EXPECT_EQ(collection["features"][0]["geometry"]["type"], "Point");
  EXPECT_EQ(collection["features"][0]["properties"]["provider_id"], "0x6e01");
  EXPECT_EQ(got[1]["subscription_id"], near["subscription_id"]);
  client->on_close();
}

TEST_F(OmloxSocket, AClientThatIsSlowGetsTheNewest) {
  const auto id = flight();
  fly(id);
  known();
  auto client = connect();
  ask(*client, subscribe("location_updates"));
  for (int i = 0; i < 1000; ++i) fly(id, k_lon + i * 1e-6);
  const auto got = read(*client);
  ASSERT_EQ(got.size(), 1U);
  EXPECT_NEAR(got[0]["payload"][0]["position"]["coordinates"][0].get<double>(), k_lon + 999e-6, 1e-9);
  client->on_close();
}

TEST_F(OmloxSocket, APositionOfAFlightThatIsNotKnownYetIsNotLost) {
  auto client = connect();
  ask(*client, subscribe("location_updates"));
  fly(flight());
  known();
  EXPECT_EQ(read(*client).size(), 1U);
  client->on_close();
}

TEST_F(OmloxSocket, WrongMessagesGetTheCodesOfTheStandard) {
  auto client = connect();
  const auto code = [&](const Json& message) {
    const Json answer = ask(*client, message);
    EXPECT_EQ(answer["event"], "error");
    EXPECT_TRUE(answer["description"].is_string());
    return answer["code"].get<int>();
  };
  EXPECT_EQ(code({{"event", "dance"}}), 10000);
  EXPECT_EQ(code(Json::array()), 10005);
  EXPECT_EQ(code(subscribe("weather")), 10001);
  EXPECT_EQ(code(subscribe("fence_events")), 10002);
  EXPECT_EQ(code({{"event", "unsubscribe"}, {"subscription_id", 77}}), 10003);
  EXPECT_EQ(code({{"event", "unsubscribe"}}), 10003);
  EXPECT_EQ(code({{"event", "message"}, {"topic", "location_updates"}, {"payload", Json::array()}}), 10004);
  EXPECT_EQ(code(subscribe("location_updates", {{"acuracy", 1}})), 10005);
  EXPECT_EQ(code(subscribe("location_updates", {{"accuracy", "1"}})), 10005);
  EXPECT_EQ(code(subscribe("location_updates", {{"crs", "local"}})), 10005);
  client->on_text("{");
  EXPECT_EQ(read(*client)[0]["code"], 10005);
  client->on_text(std::string("{\"event\":\"\xff\"}"));
  EXPECT_EQ(read(*client)[0]["code"], 10005);
  EXPECT_FALSE(client->close_request());
  client->on_close();
}

TEST_F(OmloxSocket, NobodyListensWithoutATokenThatHolds) {
  auto client = connect();
  const Json without{{"event", "subscribe"}, {"topic", "location_updates"}};
  EXPECT_EQ(ask(*client, without)["code"], 10004);
  Json wrong = subscribe("location_updates");
  wrong["params"]["token"] = "bad";
  EXPECT_EQ(ask(*client, wrong)["code"], 10004);
  EXPECT_EQ(ask(*client, subscribe("location_updates"))["event"], "subscribed");
  EXPECT_EQ(ask(*client, without)["event"], "subscribed") << "it has come in";
  holds_ = false;
  for (int i = 0; i < 10; ++i) app_->hub().tick();
  ASSERT_TRUE(client->close_request());
  EXPECT_EQ(client->close_request()->first, 4001);
  client->on_close();
}

TEST_F(OmloxSocket, ATokenOfASiteGetsTheFlightsOfThatSiteAlone) {
  site_ = hall(square_);
  const auto ours = flight(site_), of_nobody = flight();
  const auto others =
      flight(json(post("/api/v1/sites", R"({"name":"next door","origin":{"lon":4,"lat":51,"h_m":0}})"))["id"]
                 .get<std::string>());
  const auto fly_all = [&] {
    for (const auto& id : {others, ours, of_nobody}) fly(id);
  };
  fly_all();
  known();
  auto bound = connect(), all = connect();
  Json of_site = subscribe("location_updates");
  of_site["params"]["token"] = "of a site";
  bound->on_text(of_site.dump());  // what is newest of its site comes at once
  ask(*all, subscribe("location_updates"));
  fly_all();
  const auto missions_seen = [](api::WsHandler& client) {
    std::set<std::string> out;
    for (const auto& message : read(client))
      for (const auto& location : message.value("payload", Json::array()))
        out.insert(location["properties"]["anchord"]["mission"]);
    return out;
  };
  EXPECT_EQ(missions_seen(*bound), (std::set<std::string>{ours}));
  EXPECT_EQ(missions_seen(*all), (std::set<std::string>{ours, others, of_nobody}));
  // One that had come in for all, and now comes in for its site.
  fly_all();
  all->on_text(of_site.dump());
  EXPECT_EQ(missions_seen(*all), (std::set<std::string>{}));
  fly_all();
  EXPECT_EQ(missions_seen(*all), (std::set<std::string>{ours}));
  for (auto* one : {bound.get(), all.get()}) one->on_close();
}

TEST_F(OmloxSocket, StrangersAndGuessersAreLetGo) {
  auto stranger = connect(), guesser = connect(), guest = connect([] { return true; });
  for (int i = 0; i < 3; ++i) {
    Json wrong = subscribe("location_updates");
    wrong["params"]["token"] = "bad" + std::to_string(i);
    guesser->on_text(wrong.dump());
  }
  EXPECT_EQ(read(*guesser).size(), 3U) << "told why";
  ASSERT_TRUE(guesser->close_request());
  EXPECT_EQ(guesser->close_request()->first, 4001);
  for (int i = 0; i < 250; ++i) app_->hub().tick();
  ASSERT_TRUE(stranger->close_request());
  EXPECT_EQ(stranger->close_request()->first, 4001);
  EXPECT_FALSE(guest->close_request()) << "it came in with a header";
  for (auto* one : {stranger.get(), guesser.get(), guest.get()}) one->on_close();
}

TEST_F(OmloxSocket, RepliesThatNobodyReadsAreBounded) {
  auto client = connect();
  for (int i = 0; i < 1000; ++i) client->on_text("{}");
  ASSERT_TRUE(client->close_request());
  EXPECT_EQ(client->close_request()->first, 4008);
  EXPECT_LE(read(*client).size(), 64U);
  client->on_close();
}

}  // namespace
}  // namespace anchord::test::omlox_socket_test
