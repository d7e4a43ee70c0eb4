// What was declared of a flight may be corrected once it is finished: its rows stay, its estimates follow.
#include "mission_fixture.hpp"

namespace anchord::test::mission_correct_test {
namespace {

class MissionCorrection : public MissionLive {
 protected:
  std::string path(const std::string& id) { return "/api/v1/missions/" + id; }
  std::string etag(const std::string& id) { return header(get(path(id)), "ETag"); }
  api::Response correct(const std::string& id, const Json& body, const std::string& tag) {
    Call options;
    options.type = "application/merge-patch+json";
    if (!tag.empty()) options.headers = {{"if-match", tag}};
    return call(api::Method::patch, path(id), body.dump(), options);
  }
  void finish(const std::string& id) {
    ASSERT_EQ(post(path(id) + "/actions", R"({"action":"finish"})").status, 200);
  }
  std::pair<std::string, FlightData> finished_flight(const MadeFlight& made) {
    auto flight = streamed(made);
    const auto id = mission("local");
    deliver(id, flight, 0, 120.5);
    finish(id);
    return {id, std::move(flight)};
  }
  double worst_m(const std::string& id, const MadeFlight& made) {
    double worst = 0;
    for (const auto& [anchor, properties] : live(id)) {
      const auto at = properties["local_m"].get<std::vector<double>>();
      const auto& truth = made.anchors.at(std::stoul(anchor, nullptr, 16) - 0x6000);
      worst = std::max(worst, (Eigen::Vector3d(at.at(0), at.at(1), at.at(2)) - truth).norm());
    }
    return worst;
  }
};

/// The track is then of the receiver, so far below the tag.
Json arm(NetworkId tag, double up_m) {
  const Json one{{"tag", to_string(tag)}, {"antenna", 0}, {"lever_arm_body_m", {0, 0, up_m}}};
  return {{"track_point", "gnss_antenna"}, {"tags", Json::array({one})}};
}

TEST_F(MissionCorrection, OfAWrongLeverArmMovesTheEstimatesToTheTruth) {
  const MadeFlight made;
  const auto [id, flight] = finished_flight(made);
  ASSERT_EQ(correct(id, arm(flight.ranges.front().tag, 1.5), etag(id)).status, 200);
  EXPECT_GT(worst_m(id, made), 1.0) << "the arm is not used";
  ASSERT_EQ(correct(id, arm(flight.ranges.front().tag, 0), etag(id)).status, 200);
  EXPECT_LT(worst_m(id, made), 0.3);
  EXPECT_EQ(live(id).size(), 4U);
}

TEST_F(MissionCorrection, OfALeverArmHoldsBackWhatWasSolvedBefore) {
  const MadeFlight made;
  const auto [id, flight] = finished_flight(made);
  Call options;
  options.headers["prefer"] = "wait=120";
  const auto solved =
      json(call(api::Method::post, "/api/v1/calibrations", R"({"missions":[")" + id + "\"]}", options));
  const auto outdated = [&] {
    std::vector<std::string> why;
    const auto today = json(get("/api/v1/calibrations/" + solved.value("id", "")));
    for (const auto& gate : today["anchors"][0]["quality"]["gates"])
      if (gate["name"] == "outdated") why.push_back(gate["why"]);
    return why;
  };
  EXPECT_TRUE(outdated().empty());
  ASSERT_EQ(correct(id, {{"name", "second"}}, etag(id)).status, 200);
  EXPECT_TRUE(outdated().empty()) << "its name moves no anchor";
  ASSERT_EQ(correct(id, arm(flight.ranges.front().tag, 1.5), etag(id)).status, 200);
  ASSERT_EQ(outdated().size(), 1u);
  EXPECT_EQ(outdated()[0],
            "track point, lever arms or kit of flight \"second\": changed since it was solved; solve again");
}

TEST_F(MissionCorrection, IsShownAndNamedInTheEventsOfTheFlight) {
  const auto id = mission("local");
  finish(id);
  const auto site = json(post("/api/v1/sites", R"({"name":"Hall","origin":{"lon":3.7,"lat":51,"h_m":50}})"));
  const auto answer =
      correct(id, {{"name", "second"}, {"site", site["id"]}, {"lever_arm_sigma_m", 0.02}}, etag(id));
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto now = json(get(path(id)));
  EXPECT_EQ(json(answer), now);
  EXPECT_EQ(now["name"], "second");
  EXPECT_EQ(now["site"], site["id"]);
  EXPECT_EQ(now["lever_arm_sigma_m"], 0.02);
  EXPECT_EQ(now["state"], "finished");
  const auto happened = json(get(path(id) + "/events"));
  std::string events;
  for (const auto& event : happened["items"])
    if (event["code"] == "mission.corrected") events += event["text"].get<std::string>();
  EXPECT_NE(events.find("name, site, lever_arm_sigma_m"), std::string::npos) << events;
  ASSERT_EQ(correct(id, {{"site", nullptr}}, etag(id)).status, 200);
  EXPECT_EQ(json(get(path(id)))["site"], nullptr);
}

TEST_F(MissionCorrection, IsRefusedWholeWhileItRecordsOnAnOldStateAndWhereItIsNoCorrection) {
  const auto id = mission("local");
  EXPECT_EQ(correct(id, {{"name", "x"}}, etag(id)).status, 409) << "it is recording";
  finish(id);
  const auto before = get(path(id)).body;
  const auto tag = etag(id);
  EXPECT_EQ(correct(id, {{"name", "x"}}, "").status, 428);
  EXPECT_EQ(correct(id, {{"name", "x"}}, "\"m-0\"").status, 412);
  for (const Json& body :
       {Json{{"name", ""}}, Json{{"name", nullptr}}, Json{{"name", "x"}, {"frame", "wgs84"}},
        Json{{"name", "x"}, {"state", "recording"}},
        Json{{"name", "x"}, {"site", "01a20000-0000-7000-8000-000000000000"}},
        Json{{"name", "x"}, {"track_point", "nose"}}, Json{{"name", "x"}, {"lever_arm_sigma_m", 0}},
        Json::array()})
    EXPECT_EQ(correct(id, body, tag).status, 422) << body;
  EXPECT_EQ(get(path(id)).body, before);
}

}  // namespace
}  // namespace anchord::test::mission_correct_test
