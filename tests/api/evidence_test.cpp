// What a position rests on: the kit's profile, gates and who overrode them, differences, frames, the report.
#include "api/formats/report.hpp"
#include "api/formats/report_svg.hpp"
#include "app_fixture.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/types/anchor.hpp"
#include "drivers/sim/flight.hpp"

namespace anchord::test::evidence_test {
namespace {

using api::Method;

class EvidenceRoutes : public AppFixture {
 protected:
  Call with(const std::string& name, const std::string& value) {
    Call options;
    options.headers[name] = value;
    return options;
  }
  /// A simulated flight in the store; its mission.
  std::string flown(std::uint64_t seed, const std::string& kit) {
    sim::SimulationOptions options;
    options.seed = seed;
    options.range_rate_hz = 12;
    auto flight = sim::simulate_flight(sim::demonstration_world(), options).value();
    Mission mission = flight.data.mission;
    mission.id.uuid = make_uuid_v7(clock_.now());
    mission.kit = kit;
    mission.name = "flight " + std::to_string(seed) + " <b>";
    mission.created = clock_.now();
    EXPECT_TRUE(database_->stores().missions.insert(mission).has_value());
    for (auto& range : flight.data.ranges) range.mission = mission.id;
    for (auto& fix : flight.data.fixes) fix.mission = mission.id;
    EXPECT_TRUE(database_->stores().measurements.append_fixes(flight.data.fixes, true).has_value());
    EXPECT_TRUE(database_->stores().measurements.append_ranges(flight.data.ranges, true).has_value());
    return to_string(mission.id);
  }
  Json solved(const std::string& mission, const std::string& more = "") {
    Call options;
    options.headers["prefer"] = "wait=120";
    const auto response = call(Method::post, "/api/v1/calibrations",
                               R"({"missions":[")" + mission + "\"]" + more + "}", options);
    EXPECT_EQ(response.status, 201) << response.body;
    return json(response);
  }
  /// A stored calibration: 0x6a2f passes its gates, 0x6a3c fails one, both at `east_m`.
  std::string stored(double east_m = 0) {
    return stored_calibration([&](Estimate& e) {
      const bool passes = e.anchor == NetworkId{0x6a2f};
      e.best->position.m = {east_m, 7, 3};
      e.gates = {{"chi_square", passes ? 3.0 : 31.25, 16.25, passes, "residuals keep a pattern"}};
    });
  }
};

TEST_F(EvidenceRoutes, RefusesAnAnchorThatFailsAGateAndSaysWhich) {
  const auto path = "/api/v1/calibrations/" + stored() + "/publish";
  const auto refused = post(path, R"({"anchors":["0x6a2f","0x6a3c"]})");
  ASSERT_EQ(refused.status, 409) << refused.body;
  const auto gates = json(refused)["gates"];
  ASSERT_EQ(gates.size(), 1u);
  EXPECT_EQ(gates[0]["network_id"], "0x6a3c");
  EXPECT_EQ(gates[0]["name"], "chi_square");
  EXPECT_EQ(gates[0]["value"], 31.25);
  EXPECT_EQ(gates[0]["limit"], 16.25);
  EXPECT_TRUE(json(get("/api/v1/anchors"))["features"].empty()) << "nothing was published";
  // Without a list: what passes, and only that.
  const auto published = post(path, "{}");
  ASSERT_EQ(published.status, 201);
  EXPECT_EQ(json(published)["anchors"], Json::array({"0x6a2f"}));
  EXPECT_EQ(json(published)["left_out"][0]["gates"][0]["name"], "chi_square");
}

TEST_F(EvidenceRoutes, PublishesItOverAReasonThatEverybodyCanRead) {
  const auto path = "/api/v1/calibrations/" + stored() + "/publish";
  EXPECT_EQ(post(path, R"({"overrides":[{"network_id":"0x6a3c","reason":""}]})").status, 422);
  EXPECT_EQ(post(path, R"({"overrides":[{"network_id":"0x9999","reason":"x"}]})").status, 422);
  const auto published = post(path, R"({"overrides":[{"network_id":"0x6a3c","reason":"taped, agrees"}]})");
  ASSERT_EQ(published.status, 201) << published.body;
  EXPECT_EQ(json(published)["anchors"].size(), 2u);
  EXPECT_EQ(json(published)["overrides"][0]["network_id"], "0x6a3c");
  const auto quality = json(get("/api/v1/anchors/0x6a3c"))["properties"]["quality"];
  EXPECT_EQ(quality["override"]["reason"], "taped, agrees");
  EXPECT_EQ(quality["override"]["by"], "tester");
  EXPECT_FALSE(quality["acceptable"]);
  EXPECT_TRUE(json(get("/api/v1/anchors/0x6a2f"))["properties"]["quality"]["override"].is_null());
  EXPECT_EQ(json(get("/api/v1/anchors/0x6a3c/history"))["items"][0]["quality"]["override"]["reason"],
            "taped, agrees");
  const auto audit = get("/api/v1/audit").body;
  EXPECT_NE(audit.find("calibration.override"), std::string::npos);
  EXPECT_NE(audit.find("taped, agrees"), std::string::npos);
  EXPECT_NE(audit.find("residuals keep a pattern"), std::string::npos);
  EXPECT_NE(get("/api/v1/exports/anchors.csv").body.find("chi_square,\"taped, agrees\""), std::string::npos);
  const auto kml = get("/api/v1/exports/anchors.kml").body;
  EXPECT_NE(kml.find("<value>taped, agrees</value>"), std::string::npos);
  EXPECT_NE(kml.find("<coordinates>3.713100000,51.023100000"), std::string::npos) << kml;
}

TEST_F(EvidenceRoutes, AsksWhetherAPublishedAnchorMoved) {
  const auto first = stored(), second = stored(0.5);
  ASSERT_EQ(post("/api/v1/calibrations/" + first + "/publish", "{}").status, 201);
  const auto body = json(get("/api/v1/calibrations/" + second));
  const auto gates = body["anchors"][0]["quality"]["gates"];
  EXPECT_EQ(gates.back()["name"], "moved");
  EXPECT_FALSE(gates.back()["passed"]);
  // 0.5 m with sigma 0.02 m on both sides: 0.25 / 8e-4 = 312.5.
  EXPECT_NEAR(gates.back()["value"].get<double>(), 312.5, 0.1);
  EXPECT_EQ(post("/api/v1/calibrations/" + second + "/publish", "{}").status, 409);
  const auto diff = json(get("/api/v1/calibrations/" + second + "/diff"));
  EXPECT_EQ(diff["n_moved"], 1);
  EXPECT_EQ(diff["items"][0]["change"], "moved");
  EXPECT_NEAR(diff["items"][0]["delta_enu_m"][0].get<double>(), 0.5, 1e-4);
  EXPECT_EQ(diff["items"][1]["change"], "added");
  const auto same = json(get("/api/v1/calibrations/" + first + "/diff", {{"against", first}}));
  EXPECT_EQ(same["n_moved"], 0);
  EXPECT_EQ(same["items"][0]["change"], "agrees");
  EXPECT_EQ(json(get("/api/v1/revisions/1/diff"))["items"][0]["change"], "added");
  EXPECT_EQ(get("/api/v1/revisions/2/diff").status, 404);
  EXPECT_EQ(get("/api/v1/calibrations/" + first + "/diff", {{"against", "nonsense"}}).status, 422);
}

TEST_F(EvidenceRoutes, AKitLearnsFromItsFlightsAndTellsTheNext) {
  EXPECT_EQ(get("/api/v1/devices/quad-02/profile").status, 404);
  const auto first = flown(1, "quad-02");
  const auto one = solved(first);
  EXPECT_TRUE(one["provenance"]["profiles"][0]["version"].is_null()) << "nobody knew the kit yet";
  const auto read = get("/api/v1/devices/quad-02/profile");
  ASSERT_EQ(read.status, 200) << read.body;
  EXPECT_EQ(json(read)["version"], 1);
  EXPECT_EQ(json(read)["n_flights"], 1);
  EXPECT_EQ(json(read)["history"][0]["source"], "calibration " + one["id"].get<std::string>());
  // The tag it flies names the same kit.
  EXPECT_EQ(json(get("/api/v1/devices/0x6e01/profile"))["kit"], "quad-02");

  const auto two = solved(flown(2, "quad-02"));
  EXPECT_EQ(two["provenance"]["profiles"][0]["version"], 1);
  EXPECT_EQ(two["provenance"]["profiles"][0]["n_flights"], 1);
  EXPECT_EQ(json(get("/api/v1/devices/quad-02/profile"))["n_flights"], 2);
  // The lag of the simulator is 0.02 s; two flights know it better than one.
  const auto lag = json(get("/api/v1/devices/quad-02/profile"))["next_flight"]["lag_s"];
  EXPECT_NEAR(lag["value"].get<double>(), 0.02, 3 * lag["sigma"].get<double>());

  // Solved again, a flight replaces what it said, and its own word is not told to it.
  const auto again = solved(first);
  EXPECT_EQ(again["provenance"]["profiles"][0]["n_flights"], 1);
  EXPECT_EQ(json(get("/api/v1/devices/quad-02/profile"))["n_flights"], 2);
  const auto before = json(get("/api/v1/devices/quad-02/profile"))["version"];
  EXPECT_TRUE(solved(first, R"(,"profile":"none")")["provenance"]["profiles"][0]["version"].is_null());
  EXPECT_EQ(json(get("/api/v1/devices/quad-02/profile"))["version"], before) << "neither used nor taught";

  const auto file = json(get("/api/v1/devices/quad-02/profile"))["profile"].dump();
  EXPECT_EQ(call(Method::put, "/api/v1/devices/quad-02/profile", file, Call{}).status, 428);
  EXPECT_EQ(call(Method::put, "/api/v1/devices/quad-02/profile", file, with("if-match", "\"k-1\"")).status,
            412);
  const auto etag = header(get("/api/v1/devices/quad-02/profile"), "ETag");
  const auto put = call(Method::put, "/api/v1/devices/quad-02/profile", file, with("if-match", etag));
  EXPECT_EQ(put.status, 200) << put.body;
  EXPECT_EQ(json(put)["history"][0]["source"], "put");
  EXPECT_EQ(call(Method::put, "/api/v1/devices/other/profile", file, with("if-match", "*")).status, 404);
}

TEST_F(EvidenceRoutes, TransformsPositionsOfAnotherProgramsSystem) {
  // gdaltransform -s_srs EPSG:4979 -t_srs EPSG:25832 of 11.576124 48.137154.
  const std::string map = R"("points":[[691650.366852,5334754.246451,520.0]])";
  const auto answer = post("/api/v1/transform",
                           R"({"from":"crs","to":"geo","crs":"EPSG:25832","heights":"45.25",)" + map + "}");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto point = json(answer)["points"][0];
  EXPECT_NEAR(point[0].get<double>(), 11.576124, 1e-8);
  EXPECT_NEAR(point[1].get<double>(), 48.137154, 1e-8);
  EXPECT_NEAR(point[2].get<double>(), 565.25, 1e-6);
  EXPECT_EQ(json(answer)["source"]["datum"], "ETRS89");
  EXPECT_NEAR(json(answer)["source"]["convergence_deg"].get<double>(), 1.919, 1e-3);  // GeographicLib, UTMUPS

  const auto refused = [&](const std::string& what) {
    const auto response = post("/api/v1/transform", "{" + what + "," + map + "}");
    EXPECT_EQ(response.status, 422) << response.body;
    return json(response)["errors"][0]["pointer"].get<std::string>();
  };
  EXPECT_EQ(refused(R"("from":"crs","to":"geo")"), "/crs");
  EXPECT_EQ(refused(R"("from":"crs","to":"geo","crs":"EPSG:2056")"), "/crs") << "outside Switzerland";
  EXPECT_EQ(refused(R"("from":"crs","to":"geo","crs":"EPSG:4326")"), "/crs") << "no degrees";
  EXPECT_EQ(refused(R"("from":"crs","to":"geo","crs":"UTM 32N","heights":"sea")"), "/heights");
  EXPECT_EQ(refused(R"("from":"geo","to":"crs","crs":"EPSG:25832")"), "/to");
}

TEST_F(EvidenceRoutes, FitsAFrameToPublishedAnchorsAndPlaces) {
  ASSERT_EQ(post("/api/v1/calibrations/" + stored() + "/publish", "{}").status, 201);
  const auto site = post("/api/v1/sites", R"({"name":"hall","origin":{"lon":3.713,"lat":51.023,"h_m":55},
      "crs":{"frame":"ETRS89"},"projected_epsg":25831})");
  ASSERT_EQ(site.status, 201) << site.body;
  const auto site_id = json(site)["id"].get<std::string>();
  ASSERT_EQ(post("/api/v1/frames", R"({"name":"hall-a","site":")" + site_id + "\"}").status, 201);
  EXPECT_EQ(post("/api/v1/frames", R"({"name":"hall-a"})").status, 409);
  EXPECT_TRUE(json(get("/api/v1/frames/hall-a"))["fit"].is_null());
  EXPECT_EQ(
      post("/api/v1/transform", R"({"from":"local","to":"geo","frame":"hall-a","points":[[0,0,0]]})").status,
      422);
  EXPECT_EQ(post("/api/v1/frames/hall-a/fit", R"({"pairs":[{"anchor":"0x6a2f","local_m":[1,2,3]}]})").status,
            422)
      << "one pair";
  // The anchor's place is 51.0231, 3.7131, 58.4; the others lie 0.0001 degrees further, on the same height.
  const auto fit = post("/api/v1/frames/hall-a/fit", R"({"parameters":4,"pairs":[
      {"anchor":"0x6a2f","local_m":[0,0,3.4]},
      {"name":"east","local_m":[7.0173,0,3.4],"lon":3.7132,"lat":51.0231,"h_m":58.4},
      {"name":"north","local_m":[0,11.1252,3.4],"lon":3.7131,"lat":51.0232,"h_m":58.4}]})");
  ASSERT_EQ(fit.status, 200) << fit.body;
  const auto transform = json(fit)["fit"];
  // Without a turn and without a scale: metres of a degree at this latitude are of the tables of the
  // ellipsoid.
  EXPECT_NEAR(transform["scale"].get<double>(), 1.0, 1e-3);
  EXPECT_NEAR(transform["yaw_deg"].get<double>(), 0.0, 0.01);
  EXPECT_EQ(transform["residuals"].size(), 3u);
  const auto there =
      post("/api/v1/transform", R"({"from":"local","to":"geo","frame":"hall-a","points":[[0,0,3.4]]})");
  ASSERT_EQ(there.status, 200) << there.body;
  EXPECT_NEAR(json(there)["points"][0][0].get<double>(), 3.7131, 1e-7);
  EXPECT_NEAR(json(there)["points"][0][1].get<double>(), 51.0231, 1e-7);
  const auto map = json(post("/api/v1/transform", R"({"from":"geo","to":"projected","site":")" + site_id +
                                                      R"(","points":[[3.713123457,51.023123457,58.4]]})"));
  EXPECT_NEAR(map["points"][0][1].get<double>(), 5652638.279, 0.01);  // GeographicLib's UTMUPS

  // An anchor of that site is then told in the frame, on the map, and without a guessed height.
  const auto etag = header(get("/api/v1/anchors/0x6a2f"), "ETag");
  ASSERT_EQ(
      call(Method::patch, "/api/v1/anchors/0x6a2f", R"({"site":")" + site_id + "\"}", with("if-match", etag))
          .status,
      200);
  const auto p = json(get("/api/v1/anchors/0x6a2f"))["properties"];
  EXPECT_NEAR(p["local_m"][2].get<double>(), 3.4, 1e-3);
  EXPECT_EQ(p["projected"]["epsg"], 25831);
  EXPECT_EQ(p["height_orthometric_m"].is_null(), p["geoid"].is_null());
  EXPECT_EQ(p["crs"]["frame"], "ETRS89");
  const auto frame_tag = header(get("/api/v1/frames/hall-a"), "ETag");
  EXPECT_EQ(
      call(Method::patch, "/api/v1/frames/hall-a", R"({"name":"hall"})", with("if-match", frame_tag)).status,
      200);
  EXPECT_EQ(get("/api/v1/frames/hall-a").status, 404);
}

TEST_F(EvidenceRoutes, TheReportIsOnePageThatRunsNothing) {
  const auto calibration = solved(flown(3, "quad-03"), R"(,"iterations":3)");
  const auto page = get("/api/v1/calibrations/" + calibration["id"].get<std::string>() + "/report");
  ASSERT_EQ(page.status, 200) << page.body.substr(0, 300);
  const std::string& html = page.body;
  EXPECT_EQ(header(page, "Content-Type"), "text/html; charset=utf-8");
  for (const char* part : {"<svg class=\"map\"", "Acceptance gates", "Ranges not used", "Error per iteration",
                           "Calibration of the kit", "Checked by", "quad-03",
                           "Number of ranges minus unknowns", "The two halves of the flight agree"})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  for (const char* part : {"<script", "http://", "https://", "url(", "@import", "<b>,", "flight 3 <b>"})
    EXPECT_EQ(html.find(part), std::string::npos) << part;
  EXPECT_NE(html.find("flight 3 &lt;b&gt;"), std::string::npos);
  for (const char* raw : {">redundancy<", ">halves<", ">blocked<", ">chi square<"})
    EXPECT_EQ(html.find(raw), std::string::npos) << raw << " is a word of the code";
  EXPECT_EQ(get("/api/v1/calibrations/" + calibration["id"].get<std::string>() + "/report").body, html);
}

TEST(ReportText, EscapesWhatCouldBecomeMarkup) {
  EXPECT_EQ(html_text("<img src=x onerror='a'>&\"\x01"), "&lt;img src=x onerror=&#39;a&#39;&gt;&amp;&quot;");
}

TEST(ReportText, WritesNumbersWithATrueMinusAndNoMinusZero) {
  EXPECT_EQ(report::fixed(-0.1234, 3), "−0.123");
  EXPECT_EQ(report::fixed(-0.0001, 3), "0.000");
  EXPECT_EQ(report::fixed(std::nan(""), 3), "–");
}

}  // namespace
}  // namespace anchord::test::evidence_test
