// What is published to an MQTT broker: names of topics, what is sent again and what is not, what is
// forgotten. A real broker reads it in tests/server/mqtt and tests/e2e/mqtt.test.mjs.
#include "api/anchors/anchor_json.hpp"
#include "api/mqtt/mqtt_publisher.hpp"
#include "api/mqtt/mqtt_status.hpp"
#include "api/mqtt/topic_name.hpp"
#include "app_fixture.hpp"

namespace anchord::test::mqtt_test {
namespace {

using api::Topic;

// MQTT 3.1.1 sections 1.5.3 and 4.7: '/' divides levels, '+' and '#' are wildcards, U+0000 is forbidden,
// other control characters and non-characters may close the connection, '$' begins topics of the broker
// itself.
TEST(MqttTopic, OfANameHasNoCharacterThatMeansSomethingInOne) {
  EXPECT_EQ(api::topic_level("Hall A"), "Hall A");
  EXPECT_EQ(api::topic_level("Halle Süd 東"), "Halle Süd 東");
  EXPECT_EQ(api::topic_level("A/B+C#D"), "A%2FB%2BC%23D");
  EXPECT_EQ(api::topic_level(std::string("a\0b\n", 4)), "a%00b%0A");
  EXPECT_EQ(api::topic_level("$SYS"), "%24SYS");
  EXPECT_EQ(api::topic_level("_server"), "%5Fserver");
  EXPECT_EQ(api::topic_level("a_b$"), "a_b$");
  EXPECT_EQ(api::topic_level("100 %~"), "100 %25%7E");
  EXPECT_EQ(api::topic_level("\u0085"), "%C2%85");
  EXPECT_EQ(api::topic_level("\uFDD0\uFFFE"), "%EF%B7%90%EF%BF%BE");
  EXPECT_EQ(api::topic_level("\xff"), "\uFFFD");
  EXPECT_EQ(api::topic_level(""), "%");
  EXPECT_NE(api::topic_level("%2F"), api::topic_level("/"));
}

TEST(MqttTopic, BeginsWithAPrefixThatIsOne) {
  for (const char* good : {"anchord", "plant 7/uwb", "a_b"}) EXPECT_EQ(api::wrong_prefix(good), "") << good;
  for (const char* bad : {"", "/a", "a/", "a//b", "a/#", "+", "$SYS", "a\nb", "_server"})
    EXPECT_NE(api::wrong_prefix(bad), "") << bad;
  EXPECT_NE(api::wrong_prefix(std::string(201, 'a')), "");
}

class MqttPublisher : public AppFixture {
 protected:
  void SetUp() override {
    AppFixture::SetUp();
    const auto& stores = database_->stores();
    publisher_ = std::make_unique<api::MqttPublisher>(
        api::MqttPublisher::Deps{app_->hub(), stores.missions, stores.sites, stores.revisions,
                                 [this] { return published_; }, steady_, "plant/uwb", "0.0.0"});
  }
  std::map<std::string, std::string> changes(bool everything = false) {
    std::map<std::string, std::string> out;
    for (const auto& one : publisher_->changes(everything))
      EXPECT_TRUE(out.emplace(one.topic, one.payload).second) << one.topic << " twice";
    return out;
  }
  std::string site(const std::string& name) {
    return json(post("/api/v1/sites", Json{{"name", name}}.dump()))["id"];
  }
  MissionId flight(const std::string& site) {
    Json body{{"name", "f"}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}};
    if (!site.empty()) body["site"] = site;
    const auto made = post("/api/v1/missions", body.dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return MissionId{parse_uuid(json(made)["id"].get<std::string>()).value()};
  }
  void estimate(const MissionId& mission, std::uint32_t anchor, const std::string& payload) {
    app_->hub().publish(Topic::anchors_estimates, payload, 1,
                        to_string(mission) + to_string(NetworkId{anchor}), NetworkId{anchor});
  }
  void publish(std::uint32_t anchor, const std::string& site) {
    api::AnchorFeature feature;
    feature.anchor.network_id = {anchor};
    if (!site.empty()) feature.anchor.site = SiteId{parse_uuid(site).value()};
    feature.status = "accepted";
    published_.push_back(feature);
  }
  /// A revision there is, whatever is in it: the fixture's own lambda says that.
  void revision() {
    const auto id = stored_calibration([](Estimate&) {});
    const auto done = post("/api/v1/calibrations/" + id + "/publish", "{}");
    ASSERT_EQ(done.status, 201) << done.body;
  }
  struct SetSteady final : SteadyClock {
    SteadyTime now() const override { return at; }
    SteadyTime at{1};
  } steady_;
  std::vector<api::AnchorFeature> published_;
  std::unique_ptr<api::MqttPublisher> publisher_;
};

TEST_F(MqttPublisher, SaysWhatChangedAndEverythingToANewConnection) {
  const auto hall = site("Hall A/B");
  const auto mission = flight(hall);
  app_->hub().publish(Topic::alarms, "[]", 1);
  estimate(mission, 0x6a2f, R"({"n":1})");
  auto got = changes(true);
  EXPECT_EQ(got.at("plant/uwb/_server/alarms"), "[]");
  EXPECT_EQ(got.at("plant/uwb/Hall A%2FB/estimates/0x6a2f"), R"({"n":1})");
  EXPECT_EQ(Json::parse(got.at("plant/uwb/Hall A%2FB/mission"))["mission"], to_string(mission));
  EXPECT_TRUE(changes().empty());
  app_->hub().publish(Topic::alarms, "[]", 2);  // each second, with the same content
  estimate(mission, 0x6a2f, R"({"n":2})");
  estimate(mission, 0x6a2f, R"({"n":3})");
  got = changes();
  EXPECT_EQ(got,
            (std::map<std::string, std::string>{{"plant/uwb/Hall A%2FB/estimates/0x6a2f", R"({"n":3})"}}))
      << "the newest alone";
  EXPECT_EQ(changes(true).size(), 3u);
  for (const auto& message : publisher_->changes(true))
    EXPECT_EQ(message.at_least_once, message.topic == "plant/uwb/_server/alarms") << message.topic;
}

TEST_F(MqttPublisher, ShowsTheNewestMissionOfEachSiteAndForgetsEstimatesOfTheOneBefore) {
  const auto hall = site("Hall"), yard = site("Yard");
  const auto first = flight(hall), elsewhere = flight(yard);
  estimate(first, 1, "1");
  estimate(first, 2, "2");
  estimate(elsewhere, 3, "3");
  EXPECT_EQ(changes(true).count("plant/uwb/Hall/estimates/0x0002"), 1u);
  const auto second = flight(hall);
  estimate(second, 2, "22");
  auto got = changes();
  EXPECT_EQ(got.at("plant/uwb/Hall/estimates/0x0001"), "") << "the broker forgets it";
  estimate(first, 1, "11");  // a replay of the older one
  EXPECT_EQ(changes().count("plant/uwb/Hall/estimates/0x0001"), 0u);
  got = changes(true);
  EXPECT_EQ(got.at("plant/uwb/Hall/estimates/0x0002"), "22");
  EXPECT_EQ(got.at("plant/uwb/Yard/estimates/0x0003"), "3");
  EXPECT_EQ(Json::parse(got.at("plant/uwb/Hall/mission"))["mission"], to_string(second));
  EXPECT_EQ(got.count("plant/uwb/Hall/estimates/0x0001"), 0u);
}

TEST_F(MqttPublisher, PutsWhatHasNoSiteAsideAndTellsSitesOfOneNameApart) {
  const auto older = site("Hall"), newer = site("Hall");
  for (const auto& where : {older, newer, std::string()}) estimate(flight(where), 1, "1");
  const auto got = changes(true);
  EXPECT_EQ(got.count("plant/uwb/Hall/estimates/0x0001"), 1u);
  EXPECT_EQ(got.count("plant/uwb/Hall~" + newer.substr(24) + "/estimates/0x0001"), 1u);
  EXPECT_EQ(got.count("plant/uwb/_none/estimates/0x0001"), 1u);
}

TEST_F(MqttPublisher, PublishesAnchorsWithARevisionAndForgetsThoseThatMoved) {
  EXPECT_TRUE(changes(true).empty());
  revision();
  const auto hall = site("Hall");
  publish(0x6a2f, hall);
  publish(0x6a3c, "");
  auto got = changes();
  EXPECT_EQ(Json::parse(got.at("plant/uwb/Hall/anchors/0x6a2f"))["properties"]["status"], "accepted");
  EXPECT_EQ(got.count("plant/uwb/_none/anchors/0x6a3c"), 1u);
  const auto said = Json::parse(got.at("plant/uwb/_server/revision"));
  EXPECT_EQ(said["revision"], 1);
  EXPECT_EQ(said["anchors"], 2);
  published_.clear();
  publish(0x6a2f, hall);
  publish(0x6a3c, hall);
  EXPECT_TRUE(changes().empty()) << "no revision: it is looked at again half a minute later";
  steady_.at.ns += 30'000'000'000;
  got = changes();
  EXPECT_EQ(got.at("plant/uwb/_none/anchors/0x6a3c"), "");
  EXPECT_NE(got.at("plant/uwb/Hall/anchors/0x6a3c"), "");
  EXPECT_EQ(got.size(), 2u);
}

TEST_F(MqttPublisher, MovesAllOfASiteAsSoonAsItHasAnotherName) {
  changes(true);
  revision();
  const auto hall = site("Hall");
  publish(0x6a2f, hall);
  estimate(flight(hall), 0x6a2f, R"({"h95_m":0.2})");
  auto got = changes();
  for (const auto* topic : {"anchors/0x6a2f", "estimates/0x6a2f", "mission"})
    EXPECT_EQ(got.count(std::string("plant/uwb/Hall/") + topic), 1u) << topic;
  (void)changes();
  EXPECT_TRUE(changes().empty());
  const auto path = "/api/v1/sites/" + hall;
  Call options;
  options.headers = {{"if-match", header(get(path), "ETag")}};
  EXPECT_EQ(call(api::Method::patch, path, R"({"name":"Hall 2"})", options).status, 200);
  got = changes();
  for (const auto* topic : {"anchors/0x6a2f", "estimates/0x6a2f", "mission"}) {
    EXPECT_EQ(got.at(std::string("plant/uwb/Hall/") + topic), "") << topic;
    EXPECT_NE(got.at(std::string("plant/uwb/Hall 2/") + topic), "") << topic;
  }
}

TEST(MqttStatus, IsAnAlarmOnceTheBrokerIsAwayForTenSeconds) {
  BrokerStatus status{.connected = false, .address = "plant:8883", .tls = true, .reason = "no route"};
  EXPECT_EQ(api::broker_alarm(status), "");
  status.in_state_s = 10;
  EXPECT_EQ(api::broker_alarm(status), "nothing can be published to the MQTT broker plant:8883: no route");
  EXPECT_EQ(Json::parse(api::broker_json(status).dump())["state"], "disconnected");
  EXPECT_NE(api::broker_metrics(status).find("\nanchord_mqtt_connected 0\n"), std::string::npos);
  status.connected = true;
  EXPECT_EQ(api::broker_alarm(status), "");
}

}  // namespace
}  // namespace anchord::test::mqtt_test
