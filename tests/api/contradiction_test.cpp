// Published anchors that a later flight finds elsewhere, as readers, GIS, alarms and events get them.
#include <chrono>
#include <thread>

#include "app_fixture.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test::contradiction_test {
namespace {

using anchord::testing::MadeFlight;
using api::Method;

class Contradicted : public AppFixture {
 protected:
  /// A flight of that day of 2026, solved; its calibration.
  Json solved(MadeFlight m, int day) {
    m.frame = TrackFrame::wgs84;
    FlightData data = anchord::testing::make_flight(m);
    Mission mission = data.mission;
    mission.id.uuid = make_uuid_v7(clock_.now());
    mission.created = clock_.now();
    EXPECT_TRUE(database_->stores().missions.insert(mission).has_value());
    const std::int64_t ahead_ns = (1'767'225'600LL + 86'400LL * day) * 1'000'000'000;
    for (auto& fix : data.fixes) {
      fix.mission = mission.id;
      fix.time.ns += ahead_ns;
    }
    for (auto& range : data.ranges) {
      range.mission = mission.id;
      range.time.ns += ahead_ns;
    }
    EXPECT_TRUE(database_->stores().measurements.append_fixes(data.fixes, true).has_value());
    EXPECT_TRUE(database_->stores().measurements.append_ranges(data.ranges, true).has_value());
    Call options;
    options.headers["prefer"] = "wait=120";
    const auto response = call(Method::post, "/api/v1/calibrations",
                               Json{{"missions", {to_string(mission.id)}}}.dump(), options);
    EXPECT_EQ(response.status, 201) << response.body;
    return json(response);
  }
  void publish(const Json& calibration) {
    Json overrides = Json::array();
    for (const auto& anchor : calibration["anchors"])
      overrides.push_back({{"network_id", anchor["network_id"]}, {"reason", "test"}});
    const auto done = post("/api/v1/calibrations/" + calibration.value("id", "") + "/publish",
                           Json{{"overrides", overrides}}.dump());
    ASSERT_EQ(done.status, 201) << done.body;
  }
  Json properties(const std::string& id) { return json(get("/api/v1/anchors/" + id))["properties"]; }
  std::size_t n_events(const std::string& code) {
    std::size_t n = 0;
    const Json all = json(get("/api/v1/events", {{"limit", "1000"}}));
    for (const auto& event : all["items"]) n += event["code"] == code ? 1 : 0;
    return n;
  }
  /// Text of the alarm, empty where it is not up.
  std::string alarm_now() {
    const Json all = json(get("/api/v1/alarms"));
    for (const auto& alarm : all["items"]) {
      if (alarm["id"] == "anchor.contradicted") return alarm.value("text", "");
    }
    return {};
  }
  /// Waits until it is up, or is not: alarms are looked at once a second.
  std::string alarm_once(bool up) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    std::string text = alarm_now();
    while (text.empty() == up && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::yield();
      text = alarm_now();
    }
    return text;
  }
};

TEST_F(Contradicted, AnchorsAreToldToReadersAndThoseWhoStayedAreNot) {
  MadeFlight first;
  first.anchors.push_back({14, -6, 3});
  publish(solved(first, 0));
  for (const char* id : {"0x6000", "0x6001", "0x6002", "0x6003", "0x6004"}) {
    EXPECT_EQ(properties(id)["status"], "accepted");
    EXPECT_TRUE(properties(id)["contradiction"].is_null());
  }
  MadeFlight later = first;
  later.seed = 2;
  later.anchors[0] += Eigen::Vector3d(30, 0, 0);
  std::swap(later.anchors[1], later.anchors[2]);
  const Json found = solved(later, 7);

  const auto moved = properties("0x6000");
  EXPECT_EQ(moved["status"], "contradicted");
  EXPECT_FALSE(moved["quality"]["acceptable"]);
  const auto& evidence = moved["contradiction"];
  EXPECT_EQ(evidence["calibration"], found["id"]);
  EXPECT_EQ(evidence["missions"], found["missions"]);
  EXPECT_EQ(evidence["measured_at"].get<std::string>().substr(0, 10), "2026-01-08");
  EXPECT_NEAR(evidence["delta_enu_m"][0].get<double>(), 30, 1);
  EXPECT_NEAR(evidence["distance_m"].get<double>(), 30, 1);
  EXPECT_GT(evidence["chi2"], evidence["chi2_limit"]);
  EXPECT_LT(evidence["p_value"], 1e-6);
  EXPECT_TRUE(evidence["exchanged_with"].is_null());

  for (const auto& [id, other] : {std::pair{"0x6001", "0x6002"}, {"0x6002", "0x6001"}}) {
    const auto p = properties(id);
    EXPECT_EQ(p["status"], "contradicted");
    ASSERT_TRUE(p["contradiction"]["exchanged_with"].is_object()) << p["contradiction"];
    EXPECT_EQ(p["contradiction"]["exchanged_with"]["network_id"], other);
    EXPECT_NE(p["contradiction"]["text"].get<std::string>().find("0x6001 and 0x6002 look exchanged"),
              std::string::npos);
  }
  for (const char* id : {"0x6003", "0x6004"}) EXPECT_EQ(properties(id)["status"], "accepted");

  // Lists, GIS files and spreadsheets too.
  std::map<std::string, std::string> flat;
  const Json gis = json(get("/api/v1/exports/anchors.geojson", {{"flat", "true"}}));
  for (const auto& f : gis["features"]) flat[f["properties"]["network_id"]] = f["properties"]["status"];
  EXPECT_EQ(flat["0x6000"], "contradicted");
  EXPECT_EQ(flat["0x6003"], "accepted");
  EXPECT_NE(get("/api/v1/exports/anchors.csv").body.find(",contradicted,1,"), std::string::npos);

  EXPECT_EQ(n_events("anchor.contradicted"), 3u);
  const auto alarm = alarm_once(true);
  EXPECT_NE(alarm.find("0x6000"), std::string::npos) << alarm;
  EXPECT_NE(alarm.find("look exchanged"), std::string::npos) << alarm;

  // What stands is told after a restart too, without being news again.
  restart();
  EXPECT_EQ(properties("0x6000")["status"], "contradicted");
  EXPECT_NE(alarm_once(true), "");
  EXPECT_EQ(n_events("anchor.contradicted"), 0u);

  publish(found);
  EXPECT_EQ(properties("0x6000")["status"], "accepted");
  EXPECT_EQ(alarm_once(false), "");
  // What the older revision said is history.
  const auto old = json(get("/api/v1/anchors", {{"revision", "1"}}))["features"][0]["properties"];
  EXPECT_EQ(old["status"], "accepted");
}

TEST_F(Contradicted, AnchorsAreNotByAnOlderFlightNorByTheSameOneSolvedAgain) {
  MadeFlight moved;
  moved.anchors[0] += Eigen::Vector3d(30, 0, 0);
  const Json now = solved(moved, 30);
  publish(now);
  MadeFlight before;
  before.seed = 3;
  solved(before, 2);  // flown before, solved after
  EXPECT_EQ(properties("0x6000")["status"], "accepted");
  Call options;
  options.headers["prefer"] = "wait=120";
  const auto again = call(Method::post, "/api/v1/calibrations",
                          Json{{"missions", now["missions"]}, {"loss", {{"type", "huber"}}}}.dump(), options);
  ASSERT_EQ(again.status, 201) << again.body;
  EXPECT_EQ(properties("0x6000")["status"], "accepted");
}

TEST_F(Contradicted, AnchorsAreNotAnyMoreOnceALaterFlightAgreesOrTheyAreRetired) {
  publish(solved(MadeFlight{}, 0));
  MadeFlight other;
  other.seed = 2;
  other.anchors[0] += Eigen::Vector3d(0, 5, 0);
  other.anchors[1] += Eigen::Vector3d(0, 5, 0);
  solved(other, 3);
  ASSERT_EQ(properties("0x6000")["status"], "contradicted");
  const auto at = get("/api/v1/anchors/0x6001");
  Call options;
  options.type = "application/merge-patch+json";
  options.headers["if-match"] = header(at, "ETag");
  const auto retired = call(Method::patch, "/api/v1/anchors/0x6001", R"({"retired":true})", options);
  ASSERT_EQ(retired.status, 200) << retired.body;
  EXPECT_EQ(properties("0x6001")["status"], "retired");
  MadeFlight again;
  again.seed = 4;
  solved(again, 5);
  EXPECT_EQ(properties("0x6000")["status"], "accepted");
  EXPECT_EQ(alarm_once(false), "");
}

}  // namespace
}  // namespace anchord::test::contradiction_test
