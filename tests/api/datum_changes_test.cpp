// A site's datum that is changed: what is published moves, and what is made of older flights waits.
#include "calibrations_fixture.hpp"

namespace anchord::test::datum_changes_test {
namespace {

class DatumChanges : public Calibrations {
 protected:
  /// Four anchors of a site, published as revision 1; the site.
  std::string published_site() {
    const auto id = site(square(40));
    const auto answer = solved(flown(made(21), 0, id));
    const auto done = post("/api/v1/calibrations/" + answer.value("id", "") + "/publish",
                           R"({"anchors":["0x6000","0x6001","0x6002","0x6003"],"reason":"seen"})");
    EXPECT_EQ(done.status, 201) << done.body;
    return id;
  }
  Json features(const std::string& revision = "") {
    return json(revision.empty() ? get("/api/v1/anchors")
                                 : get("/api/v1/anchors", {{"revision", revision}}))["features"];
  }
  static Wgs84 place(const Json& feature) {
    const auto& at = feature["geometry"]["coordinates"];
    return {at[1].get<double>(), at[0].get<double>(), at[2].get<double>()};
  }
};

TEST_F(DatumChanges, MoveWhatIsPublishedAndKeepWhatWas) {
  const auto path = "/api/v1/sites/" + published_site() + "/datum";
  const auto before = features();
  ASSERT_EQ(before.size(), 4u);
  const std::string shift =
      R"({"shift":{"east_m":0.412,"north_m":-0.108,"up_m":0.033},"sigma_m":0.1,"note":"base surveyed again"})";
  Call dry_run;
  dry_run.query = {{"dry_run", "true"}};
  const auto tried = call(Method::post, path, shift, dry_run);
  EXPECT_EQ(tried.status, 200) << tried.body;
  EXPECT_EQ(features(), before);
  const auto done = post(path, shift);
  ASSERT_EQ(done.status, 201) << done.body;
  EXPECT_EQ(json(done)["from_revision"], 1);
  EXPECT_EQ(json(done)["revision"], 2);
  EXPECT_EQ(json(done)["anchors"], json(tried)["anchors"]);
  const auto after = features();
  ASSERT_EQ(after.size(), 4u);
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_EQ(after[i]["properties"]["network_id"], before[i]["properties"]["network_id"]);
    // Coordinates are printed to nine decimals of a degree, 0.1 mm.
    const auto moved_m = EnuFrame(place(before[i])).enu_from_wgs84(place(after[i])).m;
    EXPECT_LT((moved_m - Eigen::Vector3d(0.412, -0.108, 0.033)).norm(), 3e-4) << moved_m.transpose();
    const auto variance = [](const Json& feature) {
      return feature["properties"]["accuracy"]["relative"]["cov_enu_m2"][5].get<double>();
    };
    EXPECT_NEAR(variance(after[i]), variance(before[i]) + 0.01, 1e-4);
  }
  EXPECT_EQ(features("1"), before) << "what was published stays";
  const auto calibration = json(get("/api/v1/calibrations/" + json(done).value("calibration", "")));
  EXPECT_EQ(calibration["settings"]["datum_change"]["note"], "base surveyed again");
}

TEST_F(DatumChanges, HoldBackWhatIsMadeOfFlightsBeforeThem) {
  const auto site_id = published_site();
  /// "passed", "failed", or "" where the gate is not asked.
  const auto gate_of = [&](const std::string& id) -> std::string {
    const auto calibration = json(get("/api/v1/calibrations/" + id));
    for (const auto& gate : calibration["anchors"][0]["quality"]["gates"])
      if (gate["name"] == "datum") return gate["passed"].get<bool>() ? "passed" : "failed";
    return "";
  };
  const auto earlier = solved(flown(made(22), 0, site_id))["id"].get<std::string>();
  EXPECT_EQ(gate_of(earlier), "") << "the datum was never changed";
  clock_.ahead_s = clock_.ahead_s + 60;
  // So little that no test of two positions sees it.
  const auto done = post("/api/v1/sites/" + site_id + "/datum",
                         R"({"shift":{"east_m":0.1,"north_m":0,"up_m":0},"note":"base surveyed again"})");
  ASSERT_EQ(done.status, 201) << done.body;
  const auto after = features();
  EXPECT_EQ(gate_of(earlier), "failed");
  const auto refused = post("/api/v1/calibrations/" + earlier + "/publish", "{}");
  EXPECT_EQ(refused.status, 409) << refused.body;
  EXPECT_NE(refused.body.find("which changed the datum of the site"), std::string::npos) << refused.body;
  EXPECT_EQ(features(), after);
  clock_.ahead_s = clock_.ahead_s + 60;
  EXPECT_EQ(gate_of(solved(flown(made(23), 0, site_id))["id"].get<std::string>()), "passed");
}

TEST_F(DatumChanges, LeaveEarlierRevisionsWithTheBaseAndTheDatumTheyWereMadeWith) {
  const auto site_id = site(square(40));
  const auto set_base = [&](const std::string& crs) {
    Call options;
    options.headers["if-match"] = header(get("/api/v1/sites/" + site_id), "ETag");
    options.headers["content-type"] = "application/merge-patch+json";
    const auto done = call(Method::patch, "/api/v1/sites/" + site_id, R"({"crs":)" + crs + "}", options);
    EXPECT_EQ(done.status, 200) << done.body;
  };
  set_base(R"({"frame":"ETRF2000","epoch":2020.5,"base":{"source":"survey_in","sigma_m":1.5}})");
  const auto answer = solved(flown(made(21), 0, site_id));
  const auto published = post("/api/v1/calibrations/" + answer.value("id", "") + "/publish",
                              R"({"anchors":["0x6000","0x6001"],"reason":"seen"})");
  ASSERT_EQ(published.status, 201) << published.body;
  const auto before = features();
  ASSERT_GT(before[0]["properties"]["accuracy"]["absolute"]["h95_m"], 3.6);
  ASSERT_EQ(post("/api/v1/sites/" + site_id + "/datum",
                 R"({"shift":{"east_m":1,"north_m":0,"up_m":0},"note":"base surveyed again"})")
                .status,
            201);
  set_base(R"({"frame":"ITRF2014","epoch":2026.5,"base":{"source":"known_point","sigma_m":0.008}})");
  const auto then = features("1"), now = features();
  EXPECT_EQ(then, before) << "what was wrong by 1 m is not known to 8 mm since";
  EXPECT_LT(now[0]["properties"]["accuracy"]["absolute"]["h95_m"], 1.0);
  EXPECT_EQ(now[0]["properties"]["crs"]["frame"], "ITRF2014");
  EXPECT_EQ(then[0]["properties"]["crs"]["frame"], "ETRF2000");
}

TEST_F(DatumChanges, PutAMarkWhereItIs) {
  const auto path = "/api/v1/sites/" + published_site() + "/datum";
  const Wgs84 at = place(features()[0]);
  const Wgs84 known = EnuFrame(at).wgs84_from_enu({{1.5, 2.5, -0.5}});
  const Json mark{{"anchor", features()[0]["properties"]["network_id"]},
                  {"known", {{"lon", known.lon_deg}, {"lat", known.lat_deg}, {"h_m", known.height_m}}}};
  const auto done = post(path, Json{{"mark", mark}, {"note", "mark of the town"}}.dump());
  ASSERT_EQ(done.status, 201) << done.body;
  EXPECT_LT(EnuFrame(known).enu_from_wgs84(place(features()[0])).m.norm(), 1e-3);
}

TEST_F(DatumChanges, SayWhatIsWrongWithThem) {
  const auto path = "/api/v1/sites/" + published_site() + "/datum";
  const auto code = [&](const std::string& body) {
    const auto response = post(path, body);
    EXPECT_EQ(response.status, 422) << body << response.body;
    return json(response)["errors"][0].value("pointer", "") + " " +
           json(response)["errors"][0].value("code", "");
  };
  const std::string shift = R"("shift":{"east_m":1,"north_m":0,"up_m":0})";
  EXPECT_EQ(code("{" + shift + "}"), "/note required");
  EXPECT_EQ(code(R"({"note":"x"})"), " conflict");
  EXPECT_EQ(code("{" + shift + R"(,"helmert":{"tx_m":0,"ty_m":0,"tz_m":4.5},"note":"x"})"), " conflict");
  EXPECT_EQ(code(R"({"shift":{"east_m":1e4,"north_m":0,"up_m":0},"note":"x"})"),
            "/shift/east_m out_of_range");
  EXPECT_EQ(code(R"({"helmert":{"tx_m":0,"ty_m":0,"tz_m":4.5,"rz_arcsec":0.554},"note":"x"})"),
            "/helmert/convention required");
  EXPECT_EQ(code(R"({"mark":{"known":{"lon":4.7,"lat":50.8,"h_m":80}},"note":"x"})"),
            "/mark/measured conflict");
  EXPECT_EQ(code(R"({"mark":{"anchor":"0x7777","known":{"lon":4.7,"lat":50.8,"h_m":80}},"note":"x"})"),
            "/mark/anchor unknown_anchor");
  EXPECT_EQ(json(get("/api/v1/revisions"))["items"].size(), 1u) << "nothing was published";
  const auto elsewhere = site(square(40));
  EXPECT_EQ(post("/api/v1/sites/" + elsewhere + "/datum", "{" + shift + R"(,"note":"x"})").status, 409);
}

}  // namespace
}  // namespace anchord::test::datum_changes_test
