#include "api/formats/outline_geojson.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "api/formats/flight_plan_output.hpp"
#include "api/formats/plan_export.hpp"
#include "tests/paths.hpp"

namespace anchord::api::outline_geojson_test {
namespace {

std::string example() {
  std::ifstream file(ANCHORD_TEST_DATA "/../../docs/examples/outline.geojson");
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::string> outline_pointers(std::string_view json) {
  std::vector<FieldError> errors;
  EXPECT_FALSE(read_outline(json, errors));
  std::vector<std::string> out;
  for (const auto& e : errors) out.push_back(e.pointer + " " + e.code);
  return out;
}

// 0.00043 deg of longitude at 51.0228 N are 30.18 m, 0.00018 deg of latitude 20.03 m (WGS84 radii of
// curvature).
TEST(Outline, ReadsTheExampleInMetres) {
  std::vector<FieldError> errors;
  const auto request = read_outline(example(), errors);
  ASSERT_TRUE(request);
  ASSERT_EQ(request->input.outline.size(), 4U);
  EXPECT_NEAR((request->input.outline[1] - request->input.outline[0]).norm(), 30.18, 0.02);
  EXPECT_NEAR((request->input.outline[2] - request->input.outline[1]).norm(), 20.03, 0.02);
  EXPECT_EQ(request->input.building_height_m, 7.5);
  EXPECT_EQ(request->input.no_fly.size(), 1U);
}

TEST(Outline, NamesWhatIsWrongByPointer) {
  EXPECT_THAT(outline_pointers("{"), ::testing::SizeIs(1));
  EXPECT_THAT(outline_pointers(R"({"type":"Point","coordinates":[1,2]})"),
              ::testing::ElementsAre("/type unknown_value"));
  EXPECT_THAT(outline_pointers(R"({"type":"Polygon","coordinates":[[[3,51],[3.1,51],[3.1,"x"]]]})"),
              ::testing::ElementsAre("/coordinates/0/2 wrong_type"));
  EXPECT_THAT(outline_pointers(R"({"type":"Polygon","coordinates":[[[51,300],[3.1,51],[3.1,52]]]})"),
              ::testing::ElementsAre("/coordinates/0/0 out_of_range"));
  EXPECT_THAT(outline_pointers(R"({"type":"FeatureCollection","features":[]})"),
              ::testing::ElementsAre(" required"));
}

TEST(Outline, LosesNoFenceAndKnowsItsKindHoweverItIsWritten) {
  const auto with = [](const std::string& kind, const std::string& geometry) {
    return R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":null,"geometry":{"type":"Polygon",
      "coordinates":[[[3,51],[3.0001,51],[3.0001,51.0001],[3,51]]]}},{"type":"Feature","properties":{"kind":")" +
           kind + R"("},"geometry":)" + geometry + "}]}";
  };
  const std::string ring = "[[2.9,50.9],[3.1,50.9],[3.1,51.1],[2.9,50.9]]",
                    one = R"({"type":"Polygon","coordinates":[)" + ring + "]}";
  for (const auto* kind : {"fence", "Fence", "GEO-FENCE"}) {
    std::vector<FieldError> errors;
    const auto request = read_outline(with(kind, one), errors);
    ASSERT_TRUE(request) << kind;
    EXPECT_EQ(request->input.fence.size(), 3U) << kind;
  }
  std::vector<FieldError> errors;
  ASSERT_TRUE(read_outline(with("No fly", one), errors));
  EXPECT_THAT(outline_pointers(with("perimeter", one)),
              ::testing::Contains("/features/1/properties/kind unknown_value"));
  const auto two = R"({"type":"MultiPolygon","coordinates":[[)" + ring + "],[" + ring + "]]}";
  EXPECT_THAT(outline_pointers(with("fence", two)), ::testing::ElementsAre("/features/1/geometry conflict"));
  const auto hole = R"({"type":"Polygon","coordinates":[)" + ring + "," + ring + "]}";
  EXPECT_THAT(outline_pointers(with("fence", hole)),
              ::testing::ElementsAre("/features/1/geometry/coordinates conflict"));
}

TEST(Outline, ReadsSeveralPartsAsTheirHull) {
  std::vector<FieldError> errors;
  const auto request = read_outline(
      R"({"type":"MultiPolygon","coordinates":[[[[3,51],[3.0001,51],[3.0001,51.0001],[3,51.0001],[3,51]]],
        [[[3.0002,51],[3.0003,51],[3.0003,51.0001],[3.0002,51.0001],[3.0002,51]]]]})",
      errors);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->input.outline.size(), 4U);
}

TEST(Outline, LiesOverTheDateLine) {
  std::vector<FieldError> errors;
  const auto request = read_outline(
      R"({"type":"Polygon","coordinates":[[[179.9999,10],[-179.9999,10],[-179.9999,10.0002],[179.9999,10.0002]]]})",
      errors);
  ASSERT_TRUE(request);
  // 0.0002 degrees of longitude at 10 N: 111.32 km * cos(10 deg) * 0.0002 = 21.93 m.
  EXPECT_NEAR((request->input.outline[1] - request->input.outline[0]).norm(), 21.93, 0.02);
}

TEST(Outline, ThatCrossesItselfIsRefused) {
  EXPECT_THAT(
      outline_pointers(
          R"({"type":"Polygon","coordinates":[[[3,51],[3.001,51.001],[3.001,51],[3,51.001],[3,51]]]})"),
      ::testing::ElementsAre("/coordinates/0 self_crossing"));
}

TEST(Outline, PointsBesideTheBuildingArePassedOver) {
  std::vector<FieldError> errors;
  EXPECT_TRUE(read_outline(
      R"({"type":"FeatureCollection","features":[{"type":"Feature","geometry":{"type":"Point","coordinates":[3,51]},"properties":{}},
        {"type":"Feature","geometry":{"type":"Polygon","coordinates":[[[3,51],[3.001,51],[3.001,51.001],[3,51]]]},"properties":null}]})",
      errors));
}

TEST(FlightPlanOutput, WritesAPlanThatQGroundControlReads) {
  std::vector<FieldError> errors;
  const auto request = read_outline(example(), errors);
  ASSERT_TRUE(request);
  const planning::FlightPlanOptions options;
  const auto plan = planning::plan_flight(request->input, options).value();
  const auto qgc = nlohmann::json::parse(
      plan_qgc(flight_as_plan(plan, request->input, request->origin, options), Autopilot::px4).value());
  EXPECT_EQ(qgc["fileType"], "Plan");
  const auto& items = qgc["mission"]["items"];
  ASSERT_EQ(items.size(), plan.waypoints.size() + 3);
  EXPECT_EQ(items.front()["command"], 22);
  EXPECT_EQ(items[1]["command"], 178);  // ground speed, before the first leg
  EXPECT_EQ(items[1]["params"][1], options.speed_mps);
  EXPECT_EQ(items.back()["command"], 20);
  for (std::size_t i = 0; i < items.size(); ++i) {
    EXPECT_EQ(items[i]["doJumpId"], i + 1);
    EXPECT_EQ(items[i]["params"].size(), 7U);
  }
  EXPECT_NEAR(items[2]["params"][4].get<double>(), 51.0228, 0.001);  // latitude first here
  EXPECT_NEAR(items[2]["params"][5].get<double>(), 3.7102, 0.001);
  ASSERT_EQ(qgc["geoFence"]["polygons"].size(), 2U);  // the outline, and the example's no-fly area
  EXPECT_EQ(qgc["geoFence"]["polygons"][0]["inclusion"], false);
  EXPECT_EQ(qgc["geoFence"]["polygons"][1]["inclusion"], false);

  const auto json = nlohmann::json::parse(flight_plan_json(plan, request->origin));
  EXPECT_EQ(json["waypoints"].size(), plan.waypoints.size());
  const auto geojson = nlohmann::json::parse(flight_plan_geojson(plan, request->origin));
  EXPECT_EQ(geojson["features"].size(), plan.waypoints.size() + 1);
}

}  // namespace
}  // namespace anchord::api::outline_geojson_test
