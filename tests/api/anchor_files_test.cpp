// Files of published anchors: what is in them, and which are refused. GDAL reads each in
// tests/e2e/neighbours.test.mjs.
#include <algorithm>
#include <span>

#include "api/exchange/anchor_tables.hpp"
#include "api/exchange/step_text.hpp"
#include "api/formats/report.hpp"
#include "app_fixture.hpp"

namespace anchord::test::anchor_files_test {
namespace {

class AnchorFiles : public AppFixture {
 protected:
  /// Two anchors, published; of a site whose map system and datum are known where `mapped`.
  void publish(bool mapped) {
    const auto id = stored_calibration([](Estimate& e) {
      if (e.anchor.value == 0x6a3c) e.best->wgs84 = Wgs84{51.0232, 3.7133, 61.25};
    });
    ASSERT_EQ(post("/api/v1/calibrations/" + id + "/publish", "{}").status, 201);
    const auto site =
        post("/api/v1/sites", R"({"name":"Ghent","projected_epsg":25831,"crs":{"frame":"ETRS89"}})");
    ASSERT_EQ(site.status, 201) << site.body;
    if (!mapped) return;
    patch("0x6a2f", {{"site", json(site)["id"]}, {"floor", "0.5"}, {"name", "Hal A, \"noord\" é"}});
    patch("0x6a3c", {{"site", json(site)["id"]}, {"floor", "0-5"}});
  }
  void patch(const std::string& anchor, const Json& fields) {
    const auto path = "/api/v1/anchors/" + anchor;
    Call options;
    options.type = "application/merge-patch+json";
    options.headers["if-match"] = header(get(path), "ETag");
    const auto done = call(api::Method::patch, path, fields.dump(), options);
    ASSERT_EQ(done.status, 200) << done.body;
  }
  api::Response file(const std::string& format, std::map<std::string, std::string> query = {}) {
    query["format"] = format;
    return get("/api/v1/anchors", query);
  }
};

// Expected: gdaltransform -s_srs EPSG:4937 -t_srs EPSG:25831 (PROJ 9.1, Debian 12).
TEST_F(AnchorFiles, PnezdHasNumberNorthingEastingElevationAndDescription) {
  publish(true);
  const auto got = file("pnezd");
  ASSERT_EQ(got.status, 200) << got.body;
  EXPECT_EQ(got.body,
            "27183,5652635.6549,550012.8222,58.4000,UWB 0x6a2f Hal A   noord  é EPSG:25831 ellipsoidal\r\n"
            "27196,5652646.9109,550026.7413,61.2500,UWB 0x6a3c EPSG:25831 ellipsoidal\r\n");
  EXPECT_EQ(get("/api/v1/exports/anchors-pnezd.csv").body, got.body);
}

TEST_F(AnchorFiles, DxfHasALayerForEachFloorAlsoWhereNamesOfLayersCollide) {
  publish(true);
  const auto got = file("dxf");
  ASSERT_EQ(got.status, 200) << got.body;
  EXPECT_TRUE(got.body.starts_with("999\r\nEPSG:25831, metres, ellipsoidal heights\r\n"));
  for (const char* layer : {"\r\n2\r\nFLOOR_0_5\r\n", "\r\n2\r\nFLOOR_0-5\r\n"})
    EXPECT_NE(got.body.find(layer), std::string::npos) << layer;
  EXPECT_NE(got.body.find("\r\n1\r\nHal A, \"noord\" \\U+00E9\r\n"), std::string::npos) << "ASCII of R12";
  patch("0x6a3c", {{"floor", "0,5"}});
  EXPECT_NE(file("dxf").body.find("\r\n2\r\nFLOOR_0_5_2\r\n"), std::string::npos);
}

// AutoCAD reads %%d in a text as a degree sign, and %%% as a percent sign.
TEST_F(AnchorFiles, DxfWritesPercentSignsAndCaretsThatNoProgramReadsAsACode) {
  publish(true);
  patch("0x6a2f", {{"name", "90%%d 5% ^J"}});
  const auto got = file("dxf");
  ASSERT_EQ(got.status, 200) << got.body;
  EXPECT_NE(got.body.find("\r\n1\r\n90%%%%%%d 5% ^ J\r\n"), std::string::npos);
}

// XML 1.0, section 2.2: Char has neither of the last two code points of the plane, nor control characters.
TEST(HtmlText, KeepsOutWhatXmlForbids) {
  EXPECT_EQ(html_text("a\xEF\xBF\xBE|\xEF\xBF\xBF|\x01z"), "a\xEF\xBF\xBD|\xEF\xBF\xBD|z");
  EXPECT_EQ(html_text("\xEF\xBF\xBD\xEF\xBC\xA1<"), "\xEF\xBF\xBD\xEF\xBC\xA1&lt;");
}

// ISO 10303-21, 6.4.3: quotes and backslashes are doubled, characters outside ASCII are \X2\ with UTF-16.
TEST_F(AnchorFiles, IfcHasTextOfItsNotationAndTheGlobalIdsOfTheBuilding) {
  publish(true);
  patch("0x6a2f", {{"name", "d'Hal \\ \u00e9"}, {"ifc_guid", "2O2Fr$t4X7Zf8NOew3FLOH"}});
  patch("0x6a3c", {{"ifc_guid", "2O2Fr$t4X7Zf8NOew3FLOH"}});
  const auto got = file("ifc");
  ASSERT_EQ(got.status, 200) << got.body;
  EXPECT_NE(got.body.find("('2O2Fr$t4X7Zf8NOew3FLOH',$,'d''Hal \\\\ \\X2\\00E9\\X0\\',$,'UWB anchor'"),
            std::string::npos)
      << got.body;
  EXPECT_EQ(got.body.find("2O2Fr$t4X7Zf8NOew3FLOH"), got.body.rfind("2O2Fr$t4X7Zf8NOew3FLOH"))
      << "a GlobalId is of one thing alone";
  EXPECT_NE(got.body.find("IFCPROJECTEDCRS('EPSG:25831',$,'ETRS89','ellipsoidal height'"), std::string::npos);
  EXPECT_NE(got.body.find(",550012.0000,5652635.0000,0.,1.,0.,1.)"), std::string::npos);
  EXPECT_EQ(file("ifc").body, got.body) << "the same anchors, the same file";
}

TEST_F(AnchorFiles, OfASiteAreRefusedWhereItsAnchorsMayBeThoseInNoSiteWhichSaySo) {
  publish(false);
  const auto site = json(get("/api/v1/sites"))["items"][0]["id"].get<std::string>();
  for (const char* format : {"dxf", "ifc", "pnezd", "pozyx"}) {
    const auto got = file(format, {{"site", site}});
    EXPECT_EQ(got.status, 422) << format;
    EXPECT_NE(got.body.find("no published anchor is of this site, and 0x6a2f, 0x6a3c are in no site"),
              std::string::npos)
        << got.body;
  }
  const auto got = file("dxf");
  EXPECT_EQ(got.status, 422);
  EXPECT_NE(got.body.find("the anchor is in no site: PATCH /anchors/{id} with its site"), std::string::npos)
      << got.body;
}

// A model that joins the files of two servers would take two projects of one GlobalId for one.
// A tool that mirrors what it reads would take an empty answer for anchors that are all gone.
TEST_F(AnchorFiles, OfASiteThatIsNoneAreRefusedAndNotEmpty) {
  publish(true);
  const std::string unknown = "0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f";
  for (const char* format : {"geojson", "csv", "kml", "gpkg", "dxf", "ifc"}) {
    EXPECT_EQ(file(format, {{"site", "Ghent"}}).status, 422) << format;
    EXPECT_EQ(file(format, {{"site", unknown}}).status, 404) << format;
  }
  EXPECT_EQ(get("/api/v1/exports/anchors.csv", {{"site", unknown}}).status, 404);
  EXPECT_EQ(get("/api/v1/buildings", {{"site", "Ghent"}}).status, 422);
  EXPECT_EQ(get("/api/v1/buildings", {{"site", unknown}}).status, 404);
}

// RFC 9110, section 12.5.1.
TEST_F(AnchorFiles, AreInTheFormatThatAcceptWantsMost) {
  publish(true);
  const auto type = [&](const std::string& accept) {
    Call options;
    options.headers["accept"] = accept;
    const auto got = call(api::Method::get, "/api/v1/anchors", "", options);
    return got.status == 200 ? header(got, "Content-Type").substr(0, header(got, "Content-Type").find(';'))
                             : std::to_string(got.status);
  };
  EXPECT_EQ(type("*/*"), "application/geo+json");
  EXPECT_EQ(type("text/html, application/xhtml+xml, */*;q=0.8"), "application/geo+json");
  EXPECT_EQ(type("text/csv, */*;q=0.1"), "text/csv");
  EXPECT_EQ(type("application/geo+json;q=0, text/csv"), "text/csv");
  EXPECT_EQ(type("text/csv; q=0.9, application/geo+json;q=0.4"), "text/csv");
  EXPECT_EQ(type("TEXT/CSV"), "text/csv");
  EXPECT_EQ(type("text/*"), "text/csv");
  EXPECT_EQ(type("application/geopackage+sqlite3"), "application/geopackage+sqlite3");
  EXPECT_EQ(type("application/vnd.google-earth.kml+xml"), "application/vnd.google-earth.kml+xml");
  EXPECT_EQ(type("application/json, application/geo+json, application/problem+json"), "application/geo+json");
  EXPECT_EQ(type("image/png"), "406");
  EXPECT_EQ(type("text/csv;q=0"), "406");
}

TEST_F(AnchorFiles, IfcProjectsOfTwoSitesOfOneNameHaveTheirOwnGlobalIds) {
  publish(true);
  const auto project = [&] {
    const std::string body = file("ifc").body;
    return body.substr(body.find("IFCPROJECT('") + 12, 22);
  };
  const auto first = project();
  const auto other =
      post("/api/v1/sites", R"({"name":"Ghent","projected_epsg":25831,"crs":{"frame":"ETRS89"}})");
  patch("0x6a3c", {{"site", json(other)["id"]}});
  EXPECT_EQ(project(), first) << "of the oldest of its sites";
  patch("0x6a2f", {{"site", json(other)["id"]}});
  EXPECT_NE(project(), first);
}

// Six bits a character, two in the first: ISO 16739-1, IfcGloballyUniqueId.
TEST(StepText, PacksAUuidIntoTwentyTwoCharacters) {
  EXPECT_EQ(api::step::guid({}), "0000000000000000000000");
  Uuid all;
  all.bytes.fill(0xff);
  EXPECT_EQ(api::step::guid(all), "3$$$$$$$$$$$$$$$$$$$$$");
  for (const char* bad : {"", "000000000000000000000", "4000000000000000000000", "000000000000000000000-"})
    EXPECT_FALSE(api::step::is_guid(bad)) << bad;
  EXPECT_TRUE(api::step::is_guid("2O2Fr$t4X7Zf8NOew3FLOH"));
}

TEST(StepText, CutsNoCharacterAndKeepsLineEndsAndBrokenBytesOut) {
  EXPECT_EQ(api::step::text("a\nb\x7f"), "'a b '");
  EXPECT_EQ(api::step::text("\xff"), "'\\X2\\FFFD\\X0\\'");
  EXPECT_EQ(api::step::text("\xf0\x9d\x84\x9e"), "'\\X4\\0001D11E\\X0\\'");
  EXPECT_EQ(api::step::text(std::string(300, 'a')), "'" + std::string(255, 'a') + "'");
}

TEST_F(AnchorFiles, AreRefusedWhereAnAnchorWouldBeMissing) {
  publish(false);
  for (const char* format : {"dxf", "ifc", "pnezd", "pozyx"}) {
    const auto got = file(format);
    EXPECT_EQ(got.status, 422) << format;
    EXPECT_NE(json(got)["detail"].get<std::string>().find("0x6a2f, 0x6a3c have no "), std::string::npos)
        << got.body;
  }
  EXPECT_EQ(file("kml").status, 200) << "needs neither map nor frame";
  EXPECT_EQ(file("gpkg").status, 200);
}

TEST_F(AnchorFiles, AnEllipseOverTheDateLineGoesOnBeyond180DegreesAndNotRoundTheGlobe) {
  api::AnchorFeature beside;
  beside.estimate.emplace();
  beside.estimate->best.emplace();
  beside.estimate->best->wgs84 = Wgs84{-17.8, 180.0 - 1e-9, 12};
  beside.estimate->best->covariance_m2 = Eigen::Vector3d(0.04, 0.04, 0.1).asDiagonal();
  const auto tables = api::anchor_tables(std::span(&beside, 1), database_->stores().missions,
                                         database_->stores().measurements);
  const auto ellipses = std::ranges::find(tables, "ellipses95", &FeatureTable::name);
  ASSERT_NE(ellipses, tables.end());
  ASSERT_EQ(ellipses->rows.size(), 1u);
  double west_deg = 400, east_deg = -400;
  for (const auto& corner : ellipses->rows[0].vertices) {
    west_deg = std::min(west_deg, corner.x());
    east_deg = std::max(east_deg, corner.x());
  }
  // A sigma of 0.2 m on every side: 0.49 m with 95 %, and a degree of longitude has 106 km there.
  EXPECT_NEAR(east_deg - west_deg, 2 * 0.49 / 106'000, 1e-6);
}

TEST_F(AnchorFiles, DoNotGuessAHeight) {
  publish(true);
  const auto got = file("pnezd", {{"height", "orthometric"}});
  EXPECT_EQ(got.status, 422);
  EXPECT_NE(got.body.find("height=ellipsoidal"), std::string::npos) << got.body;
  EXPECT_EQ(file("pnezd", {{"height", "ellipsoidal"}}).status, 200);
  EXPECT_EQ(file("pnezd", {{"height", "of the tower"}}).status, 422);
  EXPECT_EQ(file("gpkg", {{"height", "ellipsoidal"}}).status, 422) << "it has both";
}

TEST_F(AnchorFiles, NeedAMapSystemThatCanBeUsedWhereItIsNamed) {
  const auto made = [&](int epsg) {
    return post("/api/v1/sites", R"({"name":"M)" + std::to_string(epsg) + R"(","projected_epsg":)" +
                                     std::to_string(epsg) + '}');
  };
  // No such code; geographic, not a map; California zone 1 in US feet; South African, which counts south and
  // west.
  for (const int epsg : {999'998, 4326, 2225, 2048}) {
    const auto refused = made(epsg);
    EXPECT_EQ(refused.status, 422) << epsg << refused.body;
    EXPECT_NE(refused.body.find("/projected_epsg"), std::string::npos) << refused.body;
  }
  const auto utm = made(25831);
  ASSERT_EQ(utm.status, 201) << utm.body;
  Call merge;
  merge.type = "application/merge-patch+json";
  merge.headers["if-match"] = header(utm, "ETag");
  EXPECT_EQ(call(api::Method::patch, header(utm, "Location"), R"({"projected_epsg":2225})", merge).status,
            422);
}

TEST_F(AnchorFiles, OfTwoMapSystemsAreRefused) {
  publish(true);
  const auto other = post("/api/v1/sites", R"({"name":"B","projected_epsg":25832,"crs":{"frame":"ETRS89"}})");
  patch("0x6a3c", {{"site", json(other)["id"]}});
  const auto got = file("dxf");
  EXPECT_EQ(got.status, 422);
  EXPECT_NE(got.body.find("EPSG:25831 and EPSG:25832: select one site"), std::string::npos) << got.body;
  EXPECT_EQ(file("dxf", {{"site", json(other)["id"]}}).status, 200);
}

TEST_F(AnchorFiles, AreThePublishedOnesWhole) {
  publish(true);
  for (const auto& query : {std::pair{"view", "live"}, {"limit", "1"}, {"cursor", "0x6a2f"}})
    EXPECT_EQ(file("gpkg", {{query.first, query.second}}).status, 422) << query.first;
  const auto other = file("shp");
  EXPECT_EQ(other.status, 406);
  EXPECT_NE(other.body.find("it has "), std::string::npos) << other.body;
  EXPECT_NE(other.body.find("gpkg"), std::string::npos) << other.body;
  const auto name = header(file("gpkg"), "Content-Disposition");
  EXPECT_EQ(name, "attachment; filename=\"anchors.gpkg\"");
}

TEST_F(AnchorFiles, OfTheSameAnchorsAreTheSameHoweverLateTheyAreAskedFor) {
  publish(true);
  for (const char* format : {"kml", "gpkg", "dxf", "ifc", "pnezd"}) {
    clock_.ahead_s = 0;
    const auto first = file(format);
    ASSERT_EQ(first.status, 200) << format << first.body;
    clock_.ahead_s = 3600;
    EXPECT_EQ(file(format).body, first.body) << format;
    EXPECT_EQ(header(file(format), "ETag"), header(first, "ETag")) << format;
  }
}

TEST_F(AnchorFiles, OfNothingPublishedAreEmptyAndValid) {
  EXPECT_EQ(file("pnezd").body, "");
  EXPECT_EQ(json(file("pozyx")), Json::array());
  EXPECT_EQ(file("ifc").body.find("IFCMAPCONVERSION"), std::string::npos) << "no map system is known";
  EXPECT_TRUE(file("ifc").body.ends_with("END-ISO-10303-21;\r\n"));
  EXPECT_TRUE(file("dxf").body.ends_with("0\r\nEOF\r\n"));
  EXPECT_TRUE(file("gpkg").body.starts_with("SQLite format 3"));
}

}  // namespace
}  // namespace anchord::test::anchor_files_test
