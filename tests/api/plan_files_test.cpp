#include <gmock/gmock.h>

#include "app_fixture.hpp"

namespace anchord::test::plan_files_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string k_hall = "[[3.7131,51.0231],[3.7135,51.0231],[3.7135,51.0233],[3.7131,51.0231]]";
const std::string k_wide = "[[3.7121,51.0221],[3.7145,51.0221],[3.7145,51.0243],[3.7121,51.0221]]";
const std::string k_pond = "[[3.7141,51.0231],[3.7142,51.0231],[3.7142,51.0233],[3.7141,51.0231]]";

std::string feature(const std::string& properties, const std::string& type, const std::string& coordinates) {
  return R"({"type":"Feature","properties":{)" + properties + R"(},"geometry":{"type":")" + type +
         R"(","coordinates":)" + coordinates + "}}";
}
std::string collection(const std::string& features) {
  return R"({"type":"FeatureCollection","features":[)" + features + "]}";
}
std::string kind(const std::string& word) { return R"("kind":")" + word + '"'; }

/// What of a plan comes in from files of other programs.
class PlanFiles : public AppFixture {
 protected:
  static constexpr const char* k_kml = "application/vnd.google-earth.kml+xml";
  Json taken(const std::string& file, const char* type = "application/json") {
    const auto answer = post("/api/v1/plans/import", file, type);
    EXPECT_EQ(answer.status, 201) << answer.body;
    return answer.status == 201 ? json(answer) : Json();
  }
  std::string refused(const std::string& file, const char* type = "application/json") {
    const auto answer = post("/api/v1/plans/import", file, type);
    EXPECT_EQ(answer.status, 422) << answer.body;
    return answer.body;
  }
};

// GDAL's `ogr2ogr -nlt MULTIPOLYGON` writes areas of one part so, QGIS by default.
TEST_F(PlanFiles, TakeAreasThatGisProgramsWriteAsMultiPolygons) {
  const auto plan = taken(collection(
      feature(kind("outline") + R"(,"height_m":12)", "MultiPolygon", "[[" + k_hall + "]]") + ',' +
      feature(kind("fence"), "MultiPolygon", "[[" + k_wide + "]]") + ',' +
      feature(kind("no_fly"), "MultiPolygon", "[[" + k_pond + "],[" + k_hall + "]]") + ',' +
      feature(R"("height_above_ground_m":5)", "MultiPoint", "[[3.7129,51.0229],[3.7130,51.0229]]")));
  EXPECT_EQ(plan["outline"]["coordinates"][0], Json::parse(k_hall));
  EXPECT_EQ(plan["building_height_m"], 12);
  EXPECT_EQ(plan["fence"]["coordinates"][0], Json::parse(k_wide));
  ASSERT_EQ(plan["no_fly"].size(), 2u);
  EXPECT_EQ(plan["no_fly"][1]["coordinates"][0], Json::parse(k_hall));
  EXPECT_EQ(plan["waypoints"].size(), 2u);
}

TEST_F(PlanFiles, KnowTheKindOfAnAreaHoweverItIsWritten) {
  for (const auto* word : {"Fence", "FENCE", "geo-fence"})
    EXPECT_TRUE(taken(collection(feature(kind(word), "Polygon", '[' + k_wide + ']')))["fence"].is_object())
        << word;
  for (const auto* word : {"No fly", "no-fly", "NoFly", "NO_FLY"})
    EXPECT_EQ(taken(collection(feature(kind(word), "Polygon", '[' + k_pond + ']')))["no_fly"].size(), 1u)
        << word;
  // Field names of a shapefile are large.
  EXPECT_TRUE(
      taken(collection(feature(R"("KIND":"fence")", "Polygon", '[' + k_wide + ']')))["fence"].is_object());
  EXPECT_THAT(
      refused(collection(feature(kind("perimeter"), "Polygon", '[' + k_wide + ']'))),
      AllOf(HasSubstr("/features/0/properties/kind"), HasSubstr("perimeter"), HasSubstr("no_fly, fence")));
  EXPECT_THAT(refused(collection(feature(R"("Name":"Fence")", "Polygon", '[' + k_wide + ']'))),
              AllOf(HasSubstr("Name is Fence"), HasSubstr("give kind fence")));
}

TEST_F(PlanFiles, RefuseAnAreaThatBoundsAFlightRatherThanLoseIt) {
  const auto fence = feature(kind("fence"), "Polygon", '[' + k_wide + ']');
  EXPECT_THAT(refused(collection(fence + ',' + feature(kind("fence"), "Polygon", '[' + k_hall + ']'))),
              AllOf(HasSubstr("/features/1"), HasSubstr("a second fence")));
  EXPECT_THAT(
      refused(collection(feature(kind("fence"), "MultiPolygon", "[[" + k_wide + "],[" + k_pond + "]]"))),
      HasSubstr("a fence of 2 parts"));
  EXPECT_THAT(refused(collection(feature(kind("fence"), "Polygon", '[' + k_wide + ',' + k_pond + ']'))),
              HasSubstr("kind no_fly"));
  for (const auto* type : {"LineString", "MultiLineString"})
    EXPECT_THAT(refused(collection(feature(kind("no_fly"), type, k_pond))), HasSubstr("make a Polygon"))
        << type;
  EXPECT_THAT(refused(collection(feature(kind("fence"), "Point", "[3.7,51]"))), HasSubstr("make a Polygon"));
  EXPECT_THAT(refused(collection(feature(kind("fence"), "Curve", "[]"))), HasSubstr("must be Polygon"));
  const auto grouped =
      R"({"type":"Feature","properties":{"kind":"fence"},"geometry":{"type":"GeometryCollection",
      "geometries":[{"type":"Polygon","coordinates":[)" +
      k_wide + "]}]}}";
  EXPECT_TRUE(taken(collection(grouped))["fence"].is_object());
}

TEST_F(PlanFiles, RefuseAHeightOfTheBuildingThatIsNone) {
  for (const auto* height : {R"("12")", "1e9", "0", "true"})
    EXPECT_THAT(refused(collection(
                    feature(kind("outline") + R"(,"height_m":)" + height, "Polygon", '[' + k_hall + ']'))),
                AllOf(HasSubstr("/features/0/properties/height_m"), HasSubstr("1 to 500 m")))
        << height;
  EXPECT_EQ(
      taken(collection(feature(R"("height_m":null)", "Polygon", '[' + k_hall + ']')))["building_height_m"],
      6);
}

TEST_F(PlanFiles, ComeWithNotesOnWhatWasLeftOutAlsoWhereTheyAreStored) {
  const auto file = collection(feature(kind("outline"), "Polygon", '[' + k_hall + ',' + k_pond + ']') + ',' +
                               feature(R"("name":"road")", "LineString", "[[3.7,51],[3.8,51]]"));
  const auto plan = taken(file);
  ASSERT_EQ(plan["notes"].size(), 2u);
  EXPECT_THAT(plan["notes"][0], HasSubstr("courtyards"));
  EXPECT_THAT(plan["notes"][1], HasSubstr("LineString"));
  const auto dry = post("/api/v1/plans/import", file, "application/json", {{"dry_run", "true"}});
  EXPECT_EQ(json(dry)["notes"], plan["notes"]);
  // The answer can be sent back as it is.
  Call call_;
  call_.headers = {{"if-match", "\"p-1\""}};
  EXPECT_EQ(
      call(api::Method::put, "/api/v1/plans/" + plan["id"].get<std::string>(), plan.dump(), call_).status,
      200);
}

TEST_F(PlanFiles, KeepEveryFenceOfAQGroundControlPlan) {
  const auto qgc = [](const std::string& fence, const std::string& items = "") {
    return R"({"fileType":"Plan","version":1,"geoFence":)" + fence + R"(,"mission":{"items":[)" + items +
           "]}}";
  };
  const std::string in = R"({"inclusion":true,"polygon":[[51.02,3.71],[51.02,3.72],[51.03,3.72]]})",
                    round = R"({"inclusion":true,"circle":{"center":[51.02,3.71],"radius":50}})";
  EXPECT_THAT(refused(qgc(R"({"polygons":[)" + in + ',' + in + "]}")),
              AllOf(HasSubstr("/geoFence/polygons/1"), HasSubstr("second inclusion")));
  EXPECT_THAT(refused(qgc(R"({"polygons":[)" + in + R"(],"circles":[)" + round + "]}")),
              HasSubstr("/geoFence/circles/0"));
  EXPECT_THAT(refused(qgc(R"({"polygons":[{"inclusion":1,"polygon":[[51,3],[51,4],[52,4]]}]})")),
              HasSubstr("must be true"));
  EXPECT_THAT(refused(qgc(R"({"polygons":{}})")), HasSubstr("array of at most 100"));
  EXPECT_THAT(refused(qgc(R"({"version":1,"polygon":[[51,3],[51,4],[52,4]]})")), HasSubstr("version 1"));
  EXPECT_THAT(
      refused(qgc("{}", R"({"type":"SimpleItem","command":5001,"frame":3,"params":[3,0,0,0,51,3,0]})")),
      HasSubstr("draw it in geoFence"));
}

// Items of an ArduPilot survey: MAV_CMD 178 speed, 16 waypoint, 93 delay, 115 yaw, 82 spline, 19 loiter, 17
// loiter without end.
TEST_F(PlanFiles, TakeSpeedHeadingsAndTimesOfAQGroundControlPlanAndSayWhatIsLeftOut) {
  const auto item = [](int command, const std::string& params) {
    return R"({"type":"SimpleItem","frame":3,"command":)" + std::to_string(command) + R"(,"params":[)" +
           params + "]}";
  };
  const auto plan =
      taken(R"({"fileType":"Plan","version":1,"geoFence":{},"mission":{"hoverSpeed":5,"items":[)" +
            item(178, "1,3,-1,0,0,0,0") + ',' + item(16, "0,0,0,null,51.02,3.71,10") + ',' +
            item(115, "90,0,0,0,0,0,0") + ',' + item(93, "7,-1,-1,-1,0,0,0") + ',' +
            item(82, "0,0,0,null,51.03,3.71,10") + ',' + item(19, "5,0,0,null,51.03,3.72,12") + ',' +
            item(17, "0,0,0,null,51.04,3.72,12") + ',' + item(178, "1,8,-1,0,0,0,0") + "]}}");
  EXPECT_EQ(plan["settings"]["speed_mps"], 3);
  ASSERT_EQ(plan["waypoints"].size(), 3u);
  EXPECT_EQ(plan["waypoints"][0]["heading_deg"], 90);
  EXPECT_EQ(plan["waypoints"][0]["dwell_s"], 7);
  EXPECT_EQ(plan["waypoints"][0]["measure"], true);
  EXPECT_EQ(plan["waypoints"][0]["turn"], false);
  EXPECT_EQ(plan["waypoints"][2]["dwell_s"], 5);
  ASSERT_EQ(plan["notes"].size(), 3u) << plan["notes"];
  EXPECT_THAT(plan["notes"][0], HasSubstr("straight line"));
  EXPECT_THAT(plan["notes"][1], AllOf(HasSubstr("/mission/items/6"), HasSubstr("its place is not flown to")));
  EXPECT_THAT(plan["notes"][2], HasSubstr("one speed"));
}

TEST_F(PlanFiles, ComeBackFromAnArduPilotExportAsTheyWereAndHaveNoYawItemsForPx4) {
  const auto made =
      json(post("/api/v1/plans", R"({"name":"Round trip","settings":{"speed_mps":1.5},"waypoints":[
      {"lon":3.7129,"lat":51.0229,"height_above_ground_m":5,"heading_deg":40,"dwell_s":6,"turn":true},
      {"lon":3.7139,"lat":51.0229,"height_above_ground_m":6,"measure":false}]})"));
  ASSERT_TRUE(made.contains("id")) << made;
  const auto path = "/api/v1/plans/" + made["id"].get<std::string>() + "/export";
  const auto again = taken(get(path).body);
  EXPECT_EQ(again["notes"].size(), 0u) << again["notes"];
  EXPECT_EQ(again["settings"]["speed_mps"], 1.5);
  ASSERT_EQ(again["waypoints"].size(), 2u);
  for (const auto* key : {"heading_deg", "dwell_s", "turn", "measure", "height_above_ground_m"})
    for (int i : {0, 1}) EXPECT_EQ(again["waypoints"][i][key], made["waypoints"][i][key]) << i << key;
  const auto px4 = Json::parse(get(path, {{"autopilot", "px4"}}).body);
  EXPECT_EQ(px4["mission"]["firmwareType"], 12);  // MAV_AUTOPILOT_PX4
  for (const auto& item : px4["mission"]["items"]) EXPECT_NE(item["command"], 115);
  EXPECT_EQ(get(path, {{"autopilot", "dji"}}).status, 422);
}

TEST_F(PlanFiles, LoseNoFenceOfKml) {
  const auto kml = [](const std::string& inside) {
    return "<kml><Placemark>" + inside + "</Placemark></kml>";
  };
  const std::string ring = "<LinearRing><coordinates>3.7,51 3.8,51 3.8,52</coordinates></LinearRing>",
                    outer = "<outerBoundaryIs>" + ring + "</outerBoundaryIs>",
                    inner = "<innerBoundaryIs>" + ring + "</innerBoundaryIs>";
  EXPECT_THAT(refused(kml("<name>Fence</name><Polygon>" + outer + inner + "</Polygon>"), k_kml),
              HasSubstr("fence with holes"));
  EXPECT_THAT(
      refused(kml("<name>No fly</name><LineString><coordinates>3,51 4,51</coordinates></LineString>"), k_kml),
      HasSubstr("as a polygon"));
  EXPECT_THAT(refused(kml("<name>Fence</name>"), k_kml), HasSubstr("without a polygon"));
  EXPECT_THAT(
      refused(
          kml(R"(<ExtendedData><Data name="kind"><value>perimeter</value></Data></ExtendedData><Polygon>)" +
              outer + "</Polygon>"),
          k_kml),
      HasSubstr("not perimeter"));
  const auto pond = taken(kml("<name>No fly</name><Polygon>" + outer + inner + "</Polygon>"), k_kml);
  EXPECT_EQ(pond["no_fly"].size(), 1u);
  EXPECT_THAT(pond["notes"][0], HasSubstr("whole of the no-fly area"));
}

}  // namespace
}  // namespace anchord::test::plan_files_test
