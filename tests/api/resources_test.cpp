// Missions, sites, anchors, calibrations: conventions of api.md section 5 over a real database.
#include "app_fixture.hpp"
#include "core/base/to_wire.hpp"
#include "core/types/anchor.hpp"

namespace anchord::test::resources_test {
namespace {

using api::Method;

class Resources : public AppFixture {
 protected:
  Call with(const std::string& name, const std::string& value) {
    Call options;
    options.headers[name] = value;
    return options;
  }
  /// A stored calibration with one believed and one ambiguous anchor.
  std::string calibration() {
    return stored_calibration([](Estimate& e) {
      if (e.anchor == NetworkId{0x6a2f}) return;
      e.verdict = Verdict::ambiguous;
      e.reason = "the mirrored place fits as well";
    });
  }
};

TEST_F(Resources, ReportEveryWrongFieldOfAMissionAtOnce) {
  const auto response = post("/api/v1/missions", R"({"nam":"x","frame":"gps","track_point":"body"})");
  EXPECT_EQ(response.status, 422);
  EXPECT_EQ(json(response)["errors"].size(), 3u) << response.body;
  EXPECT_EQ(json(response)["type"], "/problems/validation");
  EXPECT_EQ(json(response)["instance"], "/api/v1/missions");
}

TEST_F(Resources, RefuseANameOfSpaces) {
  const auto response = post("/api/v1/missions", R"({"name":"   ","frame":"wgs84","track_point":"body"})");
  EXPECT_EQ(response.status, 422);
  EXPECT_EQ(json(response)["errors"][0]["pointer"], "/name");
}

// maxLength of the contract counts characters.
TEST_F(Resources, TakeNamesOf200CharactersHoweverManyBytesTheyHave) {
  for (const std::string one : {"a", "\xc3\xa9", "\xe6\x97\xa5", "\xf0\x9f\x9b\xb0"}) {
    std::string name;
    for (int i = 0; i < 200; ++i) name += one;
    const auto mission = [&](const std::string& said) {
      return post("/api/v1/missions",
                  Json{{"name", said}, {"frame", "wgs84"}, {"track_point", "body"}}.dump());
    };
    const auto made = mission(name);
    ASSERT_EQ(made.status, 201) << made.body;
    EXPECT_EQ(json(made)["name"], name);
    const auto longer = mission(name + one);
    EXPECT_EQ(longer.status, 422);
    EXPECT_EQ(json(longer)["errors"][0]["detail"], "must be at most 200 characters");
    EXPECT_EQ(post("/api/v1/sites", Json{{"name", name}}.dump()).status, 201);
  }
}

TEST_F(Resources, RefuseControlCharactersInNamesOfTokens) {
  for (const auto& odd : {std::string("a\0b", 3), std::string("a\nb"), std::string("a\x1b[2J")}) {
    const auto token = post("/api/v1/tokens", Json{{"name", odd}, {"roles", {"viewer"}}}.dump());
    EXPECT_EQ(token.status, 422) << token.body;
    EXPECT_EQ(json(token)["errors"][0]["pointer"], "/name") << token.body;
  }
  EXPECT_EQ(post("/api/v1/tokens", R"({"name":"  ","roles":["viewer"]})").status, 422);
  EXPECT_EQ(post("/api/v1/tokens", R"({"name":"a","roles":["viewer"]})").status, 201);
}

TEST_F(Resources, FinishAMissionOnce) {
  const auto id = mission();
  EXPECT_EQ(json(post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})"))["state"], "finished");
  EXPECT_EQ(post("/api/v1/missions/" + id + "/actions", R"({"action":"finish"})").status, 422);
  EXPECT_EQ(post("/api/v1/missions/" + id + "/actions", R"({"action":"explode"})").status, 422);
  EXPECT_EQ(json(get("/api/v1/missions/" + id + "/events"))["items"].size(), 2u);
}

TEST_F(Resources, KeepEveryDigitAndEveryRingOfAnOutlineAndSayWhatIsNoCornerOfOne) {
  const auto with_outline = [](const Json& coordinates) {
    return Json{{"name", "hall"}, {"outline", {{"type", "Polygon"}, {"coordinates", coordinates}}}}.dump();
  };
  const Json yard = Json::parse(
      "[[[3.7100000000000004,51.02],[3.72,51.02],[3.72,51.030000000000001],[3.71,51.02]],"
      "[[3.711,51.021],[3.712,51.021],[3.7121234567890123,51.0221]]]");
  const auto made = post("/api/v1/sites", with_outline(yard));
  ASSERT_EQ(made.status, 201) << made.body;
  const std::string path = "/api/v1/sites/" + json(made)["id"].get<std::string>();
  ASSERT_EQ(call(Method::patch, path, R"({"name":"yard"})", with("if-match", "*")).status, 200);
  EXPECT_EQ(json(get(path))["outline"], (Json{{"type", "Polygon"}, {"coordinates", yard}}));
  ASSERT_EQ(call(Method::patch, path, R"({"outline":null})", with("if-match", "*")).status, 200);
  EXPECT_TRUE(json(get(path))["outline"].is_null());
  const std::vector<std::pair<std::string, Json>> wrong{
      {"/outline/coordinates", "round"},
      {"/outline/coordinates/0", Json::parse("[7]")},
      {"/outline/coordinates/0/1", Json::parse("[[[3.7,51],[3.7]]]")},
      {"/outline/coordinates/1/0", Json::parse(R"([[[3.7,51]],[["3.7","51"]]])")},
      {"/outline/coordinates/0/0", Json::parse("[[[51,370]]]")}};
  for (const auto& [pointer, coordinates] : wrong) {
    const auto refused = post("/api/v1/sites", with_outline(coordinates));
    EXPECT_EQ(refused.status, 422) << coordinates;
    EXPECT_EQ(json(refused)["errors"][0]["pointer"], pointer) << coordinates;
  }
}

TEST_F(Resources, PageByCursorWithoutLosingOrRepeatingRows) {
  std::set<std::string> made, seen;
  for (int i = 0; i < 7; ++i) made.insert(mission());
  std::string cursor;
  do {
    auto query = std::map<std::string, std::string>{{"limit", "3"}};
    if (!cursor.empty()) query["cursor"] = cursor;
    const auto response = get("/api/v1/missions", query);
    const auto body = json(response);
    for (const auto& item : body["items"]) EXPECT_TRUE(seen.insert(item["id"].get<std::string>()).second);
    cursor = body["next_cursor"].is_null() ? "" : body["next_cursor"].get<std::string>();
    EXPECT_EQ(header(response, "Link").empty(), cursor.empty());
  } while (!cursor.empty());
  EXPECT_EQ(seen, made);
}

TEST_F(Resources, RefuseUnknownQueryParametersAndLimits) {
  EXPECT_EQ(get("/api/v1/missions", {{"limt", "3"}}).status, 422);
  EXPECT_EQ(get("/api/v1/missions", {{"limit", "0"}}).status, 422);
  EXPECT_EQ(get("/api/v1/missions", {{"limit", "5000"}}).status, 422);
  EXPECT_EQ(get("/api/v1/missions", {{"cursor", "zzz"}}).status, 422);
}

// As CSV it was 200 and then cut off.
TEST_F(Resources, NameTheCursorThatIsNoneInEveryFormat) {
  const auto mission =
      json(post("/api/v1/missions", R"({"name":"A","frame":"local","track_point":"body"})"))["id"];
  const auto refused = {get("/api/v1/ranges", {{"cursor", "x"}}),
                        get("/api/v1/ranges", {{"cursor", "x"}, {"format", "csv"}}),
                        get("/api/v1/fixes", {{"cursor", "1.x"}, {"format", "ndjson"}}),
                        get("/api/v1/missions/" + mission.get<std::string>() + "/track", {{"cursor", "-"}})};
  for (const auto& answer : refused) {
    ASSERT_EQ(answer.status, 422) << answer.body;
    EXPECT_EQ(json(answer)["errors"][0]["pointer"], "/cursor") << answer.body;
  }
}

TEST_F(Resources, ChangeASiteOnlyWithTheEtagThatWasRead) {
  const auto made = post("/api/v1/sites", R"({"name":"Ghent","origin":{"lon":3.7,"lat":51.0,"h_m":55}})");
  ASSERT_EQ(made.status, 201) << made.body;
  const std::string path = "/api/v1/sites/" + json(made)["id"].get<std::string>();
  EXPECT_EQ(call(Method::patch, path, R"({"name":"A"})", {}).status, 428);
  const auto stale = call(Method::patch, path, R"({"name":"A"})", with("if-match", "\"s-77\""));
  EXPECT_EQ(stale.status, 412);
  EXPECT_EQ(header(stale, "ETag"), header(made, "ETag"));
  const auto changed = call(Method::patch, path, R"({"name":"A"})", with("if-match", header(made, "ETag")));
  EXPECT_EQ(changed.status, 200) << changed.body;
  EXPECT_EQ(json(changed)["origin"]["lon"], 3.7);
  EXPECT_EQ(call(Method::get, path, "", with("if-none-match", header(changed, "ETag"))).status, 304);
  EXPECT_EQ(call(Method::get, path, "", with("if-none-match", header(made, "ETag"))).status, 200);
}

// A reader that keeps what it read would go on with the old datum, accuracy and map coordinates.
TEST_F(Resources, AnAnchorsEtagChangesWithWhatItShowsOfItsSite) {
  post("/api/v1/calibrations/" + calibration() + "/publish", "");
  const auto site = post("/api/v1/sites", R"({"name":"Ghent","origin":{"lon":3.7,"lat":51.0,"h_m":55}})");
  const std::string path = "/api/v1/anchors/0x6a2f";
  const auto placed = call(Method::patch, path, to_wire(Json{{"site", json(site)["id"]}}),
                           with("if-match", header(get(path), "ETag")));
  ASSERT_EQ(placed.status, 200) << placed.body;
  const auto known = with("if-none-match", header(get(path), "ETag"));
  const auto same = call(Method::get, path, "", known);
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.body, "");
  const auto changed =
      call(Method::patch, "/api/v1/sites/" + json(site)["id"].get<std::string>(),
           R"({"crs":{"frame":"ETRS89","epoch":2026.5}})", with("if-match", header(site, "ETag")));
  ASSERT_EQ(changed.status, 200) << changed.body;
  const auto read = call(Method::get, path, "", known);
  ASSERT_EQ(read.status, 200);
  EXPECT_EQ(json(read)["properties"]["crs"]["frame"], "ETRS89");
}

// What a socket answers by itself is what the store would say: kept only until anything is written that it
// may show.
TEST_F(Resources, AnAnchorThatWasReadIsAtHandUntilAnythingIsWritten) {
  const std::string path = "/api/v1/anchors/0x6a2f";
  const auto at_hand = [&](const Call& options = {}) {
    const auto found = app_->router().resolve(Method::get, path);
    api::Request request;
    request.method = Method::get;
    request.path = path;
    request.params = found.params;
    request.query = options.query;
    request.headers = options.headers;
    return app_->at_hand(*found.route, request);
  };
  EXPECT_FALSE(at_hand()) << "nothing is published";
  post("/api/v1/calibrations/" + calibration() + "/publish", "");
  EXPECT_FALSE(at_hand()) << "nobody has read it";
  const auto read = get(path);
  const auto kept = at_hand();
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->body, read.body);
  EXPECT_EQ(header(*kept, "ETag"), header(read, "ETag"));
  const auto known = at_hand(with("if-none-match", header(read, "ETag")));
  ASSERT_TRUE(known);
  EXPECT_EQ(known->body, "");
  Call strange;
  strange.query = {{"view", "live"}};
  EXPECT_FALSE(at_hand(strange)) << "a query is the router's to judge";

  const auto site = post("/api/v1/sites", R"({"name":"Ghent","origin":{"lon":3.7,"lat":51.0,"h_m":55}})");
  EXPECT_FALSE(at_hand()) << "it may be its site";
  const auto placed = call(Method::patch, path, to_wire(Json{{"site", json(site)["id"]}}),
                           with("if-match", header(get(path), "ETag")));
  ASSERT_EQ(placed.status, 200) << placed.body;
  EXPECT_FALSE(at_hand());
  EXPECT_EQ(json(get(path))["properties"]["site"], json(site)["id"]);
  ASSERT_TRUE(at_hand());
  EXPECT_EQ(Json::parse(at_hand()->body)["properties"]["site"], json(site)["id"]);
  post("/api/v1/calibrations/" + calibration() + "/publish", "");
  EXPECT_FALSE(at_hand()) << "a new revision";
}

TEST_F(Resources, PublishOnlyWhatIsBelievedUnlessAReasonIsGiven) {
  const auto id = calibration();
  EXPECT_TRUE(json(get("/api/v1/anchors"))["features"].empty());
  EXPECT_TRUE(json(get("/api/v1/anchors"))["revision"].is_null());
  EXPECT_EQ(post("/api/v1/calibrations/" + id + "/publish", R"({"anchors":["0x6a3c"]})").status, 409);
  const auto published = post("/api/v1/calibrations/" + id + "/publish", R"({"note":"first"})");
  ASSERT_EQ(published.status, 201) << published.body;
  EXPECT_EQ(json(published)["anchors"], Json::array({"0x6a2f"}));
  EXPECT_EQ(json(published)["left_out"][0]["network_id"], "0x6a3c");
  const auto anchors = json(get("/api/v1/anchors"));
  ASSERT_EQ(anchors["features"].size(), 1u);
  EXPECT_EQ(anchors["features"][0]["geometry"]["coordinates"][0], 3.7131) << "longitude first, RFC 7946";
  EXPECT_EQ(anchors["features"][0]["geometry"]["coordinates"][1], 51.0231);
  EXPECT_EQ(
      post("/api/v1/calibrations/" + id + "/publish", R"({"anchors":["0x6a3c"],"reason":"checked by tape"})")
          .status,
      201);
  EXPECT_EQ(json(get("/api/v1/anchors"))["features"].size(), 2u);
  EXPECT_EQ(json(get("/api/v1/anchors", {{"revision", "1"}}))["features"].size(), 1u);
  EXPECT_EQ(get("/api/v1/anchors", {{"revision", "9"}}).status, 404);
  EXPECT_EQ(json(get("/api/v1/anchors/0x6a2f/history"))["items"].size(), 1u);
  const auto audit = json(get("/api/v1/audit"));
  EXPECT_NE(audit.dump().find("checked by tape"), std::string::npos);
}

TEST_F(Resources, PatchFacilityDataAndExportItSafely) {
  const auto id = calibration();
  post("/api/v1/calibrations/" + id + "/publish", "");
  const auto read = get("/api/v1/anchors/0x6a2f");
  const auto patched = call(Method::patch, "/api/v1/anchors/0x6a2f", R"({"name":"=1+1","building":"B\"1\""})",
                            with("if-match", header(read, "ETag")));
  ASSERT_EQ(patched.status, 200) << patched.body;
  const auto csv = get("/api/v1/exports/anchors.csv").body;
  EXPECT_NE(csv.find(",'=1+1,"), std::string::npos) << csv;
  EXPECT_NE(csv.find(R"("B""1""")"), std::string::npos) << csv;
  const auto below = call(Method::patch, "/api/v1/anchors/0x6a2f", R"({"floor":"-2","space":"-2+3"})",
                          with("if-match", header(patched, "ETag")));
  ASSERT_EQ(below.status, 200) << below.body;
  const auto cells = get("/api/v1/exports/anchors.csv").body;
  EXPECT_NE(cells.find(",-2,'-2+3,"), std::string::npos) << "a floor below ground is a number: " << cells;
  EXPECT_EQ(
      call(Method::patch, "/api/v1/anchors/0x6a2f", R"({"h_m":3})", with("if-match", header(below, "ETag")))
          .status,
      422);
  EXPECT_EQ(get("/api/v1/anchors/0x9999").status, 404);
  const auto flat = json(get("/api/v1/exports/anchors.geojson", {{"flat", "true"}}));
  for (const auto& [key, value] : flat["features"][0]["properties"].items())
    EXPECT_FALSE(value.is_structured()) << key;
}

TEST_F(Resources, AnswerUnknownPathsAndMethods) {
  EXPECT_EQ(get("/api/v1/nothing").status, 404);
  const auto wrong = call(Method::put, "/api/v1/missions", "", {});
  EXPECT_EQ(wrong.status, 405);
  EXPECT_EQ(header(wrong, "Allow"), "GET, HEAD, POST, OPTIONS");
  EXPECT_EQ(call(Method::options, "/api/v1/missions", "", {}).status, 204);
  EXPECT_EQ(get("/api/v1/missions/not-a-uuid").status, 404);
}

TEST_F(Resources, FailACalibrationOfAnEmptyMissionWithItsReason) {
  const auto id = mission();
  const auto response =
      call(Method::post, "/api/v1/calibrations", Json{{"missions", {id}}}.dump(), with("prefer", "wait=20"));
  EXPECT_EQ(response.status, 422) << response.body;
  EXPECT_EQ(json(get("/api/v1/jobs"))["items"][0]["state"], "failed");
  EXPECT_EQ(post("/api/v1/calibrations", R"({"missions":[],"models":{}})").status, 422);
}

TEST_F(Resources, TakeTheNoiseOfACalibrationAndRefuseNonsense) {
  const auto id = mission();
  const auto asked = [&](const Json& sigma) {
    return call(Method::post, "/api/v1/calibrations",
                Json{{"missions", {id}}, {"sigma_m", sigma}, {"initial", "bearing_height"}}.dump(), {});
  };
  EXPECT_EQ(asked({{"los", 0.049}, {"nlos", 0.234}, {"rtk", 0.02}}).status, 202);
  const auto wrong = asked({{"los", 0}, {"rkt", 0.02}});
  EXPECT_EQ(wrong.status, 422);
  EXPECT_EQ(json(wrong)["errors"].size(), 2u) << wrong.body;
}

TEST_F(Resources, RefuseToMixLocalFramesOfDifferentSites) {
  Json missions = Json::array();
  for (const char* name : {"hall A", "hall B"}) {
    const auto site = post(
        "/api/v1/sites", Json{{"name", name}, {"origin", {{"lon", 3.7}, {"lat", 51.0}, {"h_m", 5}}}}.dump());
    ASSERT_EQ(site.status, 201) << site.body;
    const auto made = post(
        "/api/v1/missions",
        Json{{"name", name}, {"frame", "local"}, {"track_point", "body"}, {"site", json(site)["id"]}}.dump());
    ASSERT_EQ(made.status, 201) << made.body;
    missions.push_back(json(made)["id"]);
  }
  const auto answer = call(Method::post, "/api/v1/calibrations", Json{{"missions", missions}}.dump(),
                           with("prefer", "wait=20"));
  EXPECT_EQ(answer.status, 422) << answer.body;
  EXPECT_NE(answer.body.find("hall A and hall B are in local frames of different sites"), std::string::npos)
      << answer.body;
}

}  // namespace
}  // namespace anchord::test::resources_test
