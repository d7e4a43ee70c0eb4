// The OGC face: what a query means, whatever client sends it. GDAL and QGIS read the same in
// tests/e2e/neighbours.test.mjs.
#include <set>

#include "app_fixture.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::test::ogc_test {
namespace {

using api::Role;

class Ogc : public AppFixture {
 protected:
  using Query = std::map<std::string, std::string>;
  /// 0x6a2f at Ghent, 0x6a3c beside the antimeridian; published as revision 1.
  void publish() {
    const auto id = stored_calibration([](Estimate& e) {
      if (e.anchor.value == 0x6a3c) e.best->wgs84 = Wgs84{-17.5, 179.99, 12.25};
    });
    const auto made = post("/api/v1/calibrations/" + id + "/publish", "{}");
    ASSERT_EQ(made.status, 201) << made.body;
  }
  Json items(const std::string& collection, Query query = {}, int status = 200) {
    const auto response = get("/ogc/collections/" + collection + "/items", std::move(query));
    EXPECT_EQ(response.status, status) << response.body;
    return Json::parse(response.body);
  }
  static std::set<std::string> anchors(const Json& page) {
    std::set<std::string> out;
    for (const auto& feature : page["features"]) out.insert(feature["properties"]["network_id"]);
    return out;
  }
  using Names = std::set<std::string>;
};

TEST_F(Ogc, ABoxHoldsWhatIsInItAlsoAcrossTheAntimeridianAndBetweenHeights) {
  publish();
  EXPECT_EQ(anchors(items("anchors")), (Names{"0x6a2f", "0x6a3c"}));
  EXPECT_EQ(anchors(items("anchors", {{"bbox", "3,51,4,52"}})), Names{"0x6a2f"});
  EXPECT_EQ(anchors(items("anchors", {{"bbox", "179,-18,-179,-17"}})), Names{"0x6a3c"});
  EXPECT_EQ(anchors(items("anchors", {{"bbox", "-180,-90,58,180,90,59"}})), Names{"0x6a2f"});
  EXPECT_EQ(anchors(items("anchors", {{"bbox", "51,3,52,4"},
                                      {"bbox-crs", "http://www.opengis.net/def/crs/EPSG/0/4326"}})),
            Names{"0x6a2f"});
  EXPECT_EQ(items("anchors", {{"bbox", "5,51,6,52"}})["numberMatched"], 0);
}

TEST_F(Ogc, ABoxAcrossTheAntimeridianHoldsTheSameForAnchorsAndTheirFiles) {
  publish();
  const Query across{{"bbox", "179,-18,-179,-17"}};
  EXPECT_EQ(anchors(json(get("/api/v1/anchors", across))), Names{"0x6a3c"});
  EXPECT_EQ(anchors(json(get("/api/v1/exports/anchors.geojson", across))), Names{"0x6a3c"});
  EXPECT_EQ(anchors(json(get("/api/v1/anchors", {{"bbox", "3,51,4,52"}}))), Names{"0x6a2f"});
  const auto upside_down = get("/api/v1/anchors", {{"bbox", "3,52,4,51"}});
  EXPECT_EQ(upside_down.status, 422);
  EXPECT_EQ(json(upside_down)["errors"][0]["pointer"], "/bbox");
}

TEST_F(Ogc, CoordinatesComeInTheOrderOfTheSystemThatWasAskedFor) {
  publish();
  const std::string point = "/ogc/collections/anchors/items/0x6a2f";
  const auto at = [&](const Query& query) { return json(get(point, query))["geometry"]["coordinates"]; };
  EXPECT_EQ(at({}), Json({3.7131, 51.0231, 58.4}));
  EXPECT_EQ(at({{"crs", "http://www.opengis.net/def/crs/EPSG/0/4979"}}), Json({51.0231, 3.7131, 58.4}));
  EXPECT_EQ(at({{"crs", "http://www.opengis.net/def/crs/OGC/1.3/CRS84"}}), Json({3.7131, 51.0231}));
  EXPECT_EQ(header(get(point, {{"crs", "http://www.opengis.net/def/crs/EPSG/0/4979"}}), "Content-Crs"),
            "<http://www.opengis.net/def/crs/EPSG/0/4979>");
  EXPECT_EQ(header(get(point), "Content-Crs"), "<http://www.opengis.net/def/crs/OGC/0/CRS84h>");
  EXPECT_EQ(get(point, {{"crs", "http://www.opengis.net/def/crs/EPSG/0/25831"}}).status, 400);
}

TEST_F(Ogc, PagesShowEachFeatureOnce) {
  publish();
  const Json first = items("anchors", {{"limit", "1"}});
  EXPECT_EQ(first["numberReturned"], 1);
  EXPECT_EQ(first["numberMatched"], 2);
  ASSERT_EQ(first["links"].size(), 2U);
  EXPECT_EQ(first["links"][1]["rel"], "next");
  EXPECT_EQ(first["links"][1]["href"], "/ogc/collections/anchors/items?limit=1&cursor=0x6a3c.1");
  const Json second = items("anchors", {{"limit", "1"}, {"cursor", "0x6a3c.1"}});
  EXPECT_EQ(anchors(first), Names{"0x6a2f"});
  EXPECT_EQ(anchors(second), Names{"0x6a3c"});
  EXPECT_EQ(second["links"].size(), 1U);
  EXPECT_EQ(items("anchors", {{"limit", "1000000"}})["numberReturned"], 2)
      << "the maximum, as the standard has it";
}

TEST_F(Ogc, PagesAreOfTheRevisionOfTheFirstWhateverIsPublishedBetween) {
  publish();
  const Json first = items("anchors", {{"limit", "1"}}),
             native = json(get("/api/v1/anchors", {{"limit", "1"}}));
  publish();
  const Json rest = items("anchors", {{"limit", "1"}, {"cursor", "0x6a3c.1"}});
  EXPECT_EQ(first["features"][0]["properties"]["revision"], 1);
  EXPECT_EQ(rest["features"][0]["properties"]["revision"], 1);
  EXPECT_EQ(native["next_cursor"], "0x6a2f.1");
  const Json next = json(get("/api/v1/anchors", {{"limit", "1"}, {"cursor", native["next_cursor"]}}));
  EXPECT_EQ(next["revision"], 1);
  EXPECT_EQ(next["features"][0]["properties"]["network_id"], "0x6a3c");
  EXPECT_EQ(json(get("/api/v1/anchors"))["revision"], 2);
  for (const char* cursor : {"0x6a3c.3", "0x6a3c.x", "0x6a3c.", "0x6a3c.0", "x.1"})
    items("anchors", {{"cursor", cursor}}, 400);
  // A cursor of before has no revision, and goes on in the newest.
  EXPECT_EQ(anchors(items("anchors", {{"cursor", "0x6a3c"}})), Names{"0x6a3c"});
}

TEST_F(Ogc, ABoxBeyond180DegreesIsTheSameOverTheAntimeridian) {
  publish();
  for (const char* box : {"170,-20,190,-10", "-190,-20,-170,-10", "179,-18,181,-17", "-200,-90,400,0"}) {
    EXPECT_EQ(anchors(items("anchors", {{"bbox", box}})), Names{"0x6a3c"}) << box;
    EXPECT_EQ(anchors(json(get("/api/v1/anchors", {{"bbox", box}}))), Names{"0x6a3c"}) << box;
  }
  EXPECT_EQ(anchors(items("anchors", {{"bbox", "-180.00015,-90,180,90"}})), (Names{"0x6a2f", "0x6a3c"}));
  EXPECT_EQ(items("anchors", {{"bbox", "180.5,-20,190,-10"}})["numberMatched"], 0);
}

TEST_F(Ogc, ATimeMayHaveAnOffset) {
  publish();
  const std::string when = items("anchors")["features"][0]["properties"]["calibrated_at"];
  const auto at = parse_rfc3339(when).value();
  // From a second before to a second after, so many hours later by the clock on the wall.
  const auto shifted = [&](int hours, const std::string& offset) {
    const auto wall = [&](int seconds) {
      auto text = to_rfc3339(UtcTime{at.ns + std::int64_t{1'000'000'000} * (3600 * hours + seconds)});
      text.pop_back();
      return text + offset;
    };
    return wall(-1) + "/" + wall(1);
  };
  EXPECT_EQ(items("anchors", {{"datetime", shifted(2, "+02:00")}})["numberMatched"], 2);
  EXPECT_EQ(items("anchors", {{"datetime", shifted(-3, "-03:00")}})["numberMatched"], 2);
  EXPECT_EQ(items("anchors", {{"datetime", shifted(0, "+02:00")}})["numberMatched"], 0);
  // As the server writes it, and as a mirror asks for what it has seen and for what is newer.
  EXPECT_EQ(items("anchors", {{"datetime", when}})["numberMatched"], 2);
  EXPECT_EQ(items("anchors", {{"datetime", when + "/" + when}})["numberMatched"], 2);
  EXPECT_EQ(items("anchors", {{"datetime", "../" + when}})["numberMatched"], 2);
  items("anchors", {{"datetime", shifted(0, "+2:00")}}, 400);
  items("anchors", {{"datetime", shifted(0, "+25:00")}}, 400);
}

TEST_F(Ogc, LinksAreAbsoluteAndSayHowAProxyWasAsked) {
  Call options;
  options.headers["host"] = "anchord.example:8420";
  const auto self = [&] { return json(call(api::Method::get, "/ogc", "", options))["links"][0]["href"]; };
  EXPECT_EQ(self(), "http://anchord.example:8420/ogc");
  options.headers["x-forwarded-proto"] = "https";
  EXPECT_EQ(self(), "https://anchord.example:8420/ogc");
}

TEST_F(Ogc, ARevisionIsOneFeatureForEachPositionItSet) {
  publish();
  publish();
  const Json page = items("revisions");
  ASSERT_EQ(page["numberMatched"], 4);
  std::set<std::string> newest, ids;
  for (const auto& feature : page["features"]) {
    ids.insert(feature["id"]);
    if (feature["properties"]["newest"]) newest.insert(feature["id"]);
  }
  EXPECT_EQ(ids, (Names{"1-0x6a2f", "2-0x6a2f", "1-0x6a3c", "2-0x6a3c"}));
  EXPECT_EQ(newest, (Names{"2-0x6a2f", "2-0x6a3c"}));
  const std::string when = page["features"][0]["properties"]["calibrated_at"];
  EXPECT_EQ(items("revisions", {{"datetime", when + "/.."}})["numberMatched"], 2);
  EXPECT_EQ(items("revisions", {{"datetime", "2001-01-01T00:00:00Z/2002-01-01T00:00:00Z"}})["numberMatched"],
            0);
  EXPECT_EQ(get("/ogc/collections/revisions/items/1-0x6a3c").status, 200);
  EXPECT_EQ(get("/ogc/collections/revisions/items/9-0x6a3c").status, 404);
}

// A metre of latitude is 1 / 111 252 degree at 51 N (WGS 84, meridian radius of curvature 6 374 241 m).
TEST_F(Ogc, ATrackKeepsThePathAndNotTheHovering) {
  const auto id = mission();
  std::string rows;
  for (int i = 0; i < 300; ++i) {
    const double lat_deg = 51.0 + (i < 100 ? 0 : (i - 99) * 0.1 / 111252);  // hovers, then 0.1 m each
    rows += R"({"t_us":)" + std::to_string(1777889472000000LL + i * 100000LL) + R"(,"lon":3.7,"lat":)" +
            to_wire(Json(lat_deg)) + R"(,"h_m":60.5,"fix":"fixed"})" + "\n";
  }
  ASSERT_EQ(post("/api/v1/fixes", rows, "application/x-ndjson", {{"mission", id}}).status, 200);
  const Json track = items("tracks")["features"][0];
  EXPECT_EQ(track["properties"]["n_fixes"], 300);
  EXPECT_EQ(track["geometry"]["type"], "LineString");
  EXPECT_EQ(track["geometry"]["coordinates"].size(), 201U);
  EXPECT_EQ(track["geometry"]["coordinates"][0], Json({3.7, 51.0, 60.5}));
  EXPECT_EQ(items("tracks", {{"bbox", "3,50,4,52"}})["numberReturned"], 1);
  EXPECT_EQ(items("tracks", {{"bbox", "5,50,6,52"}})["numberReturned"], 0);
  EXPECT_EQ(items("tracks", {{"datetime", "2026-05-04T10:11:20Z"}})["numberReturned"], 1)
      << "during the flight";
  EXPECT_EQ(items("tracks", {{"datetime", "../2026-05-04T10:11:11Z"}})["numberReturned"], 0);
  EXPECT_EQ(get("/ogc/collections/tracks/items/" + id).status, 200);
}

// From 179.9999 to -179.9999 a map would draw the path round the globe.
TEST_F(Ogc, ATrackOverTheDateLineStaysTogether) {
  const auto id = mission();
  std::string rows;
  for (int i = 0; i < 4; ++i)
    rows += R"({"t_us":)" + std::to_string(1777889472000000LL + i * 1000000LL) + R"(,"lon":)" +
            (i % 2 == 0 ? "179.9999" : "-179.9999") + R"(,"lat":-16.8,"h_m":60.5,"fix":"fixed"})" + "\n";
  ASSERT_EQ(post("/api/v1/fixes", rows, "application/x-ndjson", {{"mission", id}}).status, 200);
  for (const Json& line : {items("tracks")["features"][0]["geometry"]["coordinates"],
                           json(get("/api/v1/missions/" + id + "/track"))["geometry"]["coordinates"]}) {
    ASSERT_EQ(line.size(), 4U) << line;
    for (std::size_t i = 0; i < line.size(); ++i)
      EXPECT_NEAR(line[i][0].get<double>(), i % 2 == 0 ? 179.9999 : 180.0001, 1e-9) << line;
  }
  EXPECT_EQ(items("tracks", {{"bbox", "179,-17,-179,-16"}})["numberReturned"], 1);
}

// Three times round the pole, 30 degrees each: added up they come to 1080.
TEST_F(Ogc, ATrackRoundAPoleKeepsToLongitudesThatMapsHave) {
  const auto id = mission();
  std::string rows;
  for (int i = 0; i < 36; ++i)
    rows += R"({"t_us":)" + std::to_string(1777889472000000LL + i * 1000000LL) + R"(,"lon":)" +
            std::to_string((30 * i + 180) % 360 - 180) + R"(,"lat":89.9999,"h_m":60.5,"fix":"fixed"})" + "\n";
  ASSERT_EQ(post("/api/v1/fixes", rows, "application/x-ndjson", {{"mission", id}}).status, 200);
  for (const Json& line : {items("tracks")["features"][0]["geometry"]["coordinates"],
                           json(get("/api/v1/missions/" + id + "/track"))["geometry"]["coordinates"]}) {
    ASSERT_EQ(line.size(), 36U);
    for (std::size_t i = 0; i < line.size(); ++i) {
      const double lon_deg = line[i][0];
      EXPECT_LE(std::abs(lon_deg), 360) << i;
      EXPECT_NEAR(std::remainder(lon_deg - 30.0 * static_cast<double>(i), 360), 0, 1e-9) << i;
    }
  }
}

TEST_F(Ogc, AFlightWithoutAPlaceOnTheGlobeHasNoGeometry) {
  mission("local");
  mission();  // without a position
  const Json page = items("tracks", {{"limit", "1"}});
  EXPECT_EQ(page["features"][0]["geometry"], nullptr);
  EXPECT_EQ(page["links"].size(), 2U);
  EXPECT_EQ(items("tracks")["features"][1]["geometry"], nullptr);
}

// QGIS asks for the box of its window, which lies inside of a floor when somebody zoomed in.
TEST_F(Ogc, AZoneIsAFloorWithItsAcceptedOutlineAndIsInEveryBoxThatItReachesInto) {
  const auto site = json(post("/api/v1/sites", R"({"name":"Ghent"})"))["id"].get<std::string>();
  const auto building =
      json(post("/api/v1/buildings", R"({"name":"B1","height_m":9,"site":")" + site + "\"}"))["id"];
  const auto floor = [&](const char* name) {
    const auto made =
        post("/api/v1/floors", to_wire(Json{{"name", name}, {"level", 0}, {"building", building}}));
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made)["id"].get<std::string>();
  };
  const auto ground = floor("Ground"), bare = floor("Roof");
  Call options;
  options.headers["if-match"] = header(get("/api/v1/floors/" + ground), "ETag");
  const auto kept = call(
      api::Method::put, "/api/v1/floors/" + ground + "/walls",
      R"({"walls":[],"outline":{"type":"Polygon","coordinates":[[[3.7,51],[3.702,51],[3.702,51.001],[3.7,51.001],[3.7,51]]]}})",
      options);
  ASSERT_EQ(kept.status, 200) << kept.body;
  const auto all = items("zones");
  ASSERT_EQ(all["features"].size(), 2u);
  EXPECT_TRUE(all["features"][1]["geometry"].is_null()) << "nobody accepted an outline of " << bare;
  const auto& zone = all["features"][0];
  EXPECT_EQ(zone["id"], ground);
  EXPECT_EQ(zone["geometry"]["coordinates"][0][2], Json({3.702, 51.001}));
  EXPECT_EQ(zone["properties"]["building"], "B1");
  EXPECT_EQ(zone["properties"]["site"], site);
  EXPECT_EQ(items("zones", {{"bbox", "3.7009,51.0004,3.7011,51.0006"}})["numberMatched"], 1);
  EXPECT_EQ(items("zones", {{"bbox", "3.703,51,3.71,51.1"}})["numberMatched"], 0);
  const auto one =
      get("/ogc/collections/zones/items/" + ground, {{"crs", "http://www.opengis.net/def/crs/EPSG/0/4326"}});
  EXPECT_EQ(json(one)["geometry"]["coordinates"][0][2], Json({51.001, 3.702}));
  EXPECT_EQ(header(get("/ogc/collections/zones/items"), "Content-Crs"),
            "<http://www.opengis.net/def/crs/OGC/1.3/CRS84>");
  items("zones", {{"crs", "http://www.opengis.net/def/crs/EPSG/0/4979"}}, 400);
  const auto about = json(get("/ogc/collections/zones"));
  EXPECT_EQ(about["extent"]["spatial"]["bbox"][0], Json({3.7, 51.0, 3.702, 51.001}));
  EXPECT_EQ(about["storageCrs"], "http://www.opengis.net/def/crs/OGC/1.3/CRS84");
}

TEST_F(Ogc, WrongQueriesAreBadRequests) {
  for (const Query& wrong :
       {Query{{"bbox", "1,2,3"}}, Query{{"bbox", "1,2,3,x"}}, Query{{"bbox", "1,5,2,4"}},
        Query{{"limit", "0"}}, Query{{"limit", "many"}}, Query{{"datetime", "yesterday"}},
        Query{{"cursor", "nobody"}}, Query{{"datetime", "2026-05-05T00:00:00Z/2026-05-04T00:00:00Z"}},
        Query{{"colour", "red"}}, Query{{"f", "html"}}}) {
    const Json problem = items("anchors", wrong, 400);
    EXPECT_EQ(problem["errors"].size(), 1U) << wrong.begin()->first;
  }
  EXPECT_EQ(get("/ogc/collections/walls").status, 404);
  EXPECT_EQ(get("/ogc", {{"colour", "red"}}).status, 400);
}

TEST_F(Ogc, IsForReadersAndNobodyElse) {
  for (const auto& route : app_->router().routes()) {
    if (!route.pattern.starts_with("/ogc")) continue;
    EXPECT_EQ(route.method, api::Method::get) << route.pattern;
    for (const Role role : {Role::viewer, Role::integrator, Role::engineer, Role::op, Role::admin})
      EXPECT_TRUE(route.access.permits({"x", "x", {role}})) << route.pattern << ' ' << to_string(role);
    EXPECT_FALSE(route.access.permits({"x", "x", {Role::gateway}})) << route.pattern;
    EXPECT_FALSE(route.access.permits({"x", "x", {}})) << route.pattern;
  }
}

}  // namespace
}  // namespace anchord::test::ogc_test
