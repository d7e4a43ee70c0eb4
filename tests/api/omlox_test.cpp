// The omlox face, against what the schemas of hub API 2.0.0 require (Zone, LocationProvider, Trackable,
// Location, Error) and what the page of the "objects" dialect has instead.
#include "api/omlox/omlox_uuid.hpp"
#include "omlox_fixture.hpp"

namespace anchord::test::omlox_test {
namespace {

using api::Method;
using api::Role;

class Omlox : public OmloxFixture {
 protected:
  api::Response put(const std::string& path, const Json& body,
                    std::map<std::string, std::string> query = {}) {
    Call options;
    options.query = std::move(query);
    return call(Method::put, path, body.dump(), options);
  }
  Json zone(std::map<std::string, std::string> query = {}) {
    const auto all = json(get("/omlox/v2/zones/summary", std::move(query)));
    EXPECT_EQ(all.size(), 1U) << all;
    return all.empty() ? Json() : all[0];
  }
  /// What is required of a Location, and that its point is GeoJSON.
  static void expect_location(const Json& one) {
    for (const char* key : {"position", "source", "provider_type", "provider_id"})
      EXPECT_TRUE(one.contains(key)) << key << " is required: " << one;
    EXPECT_EQ(one["position"]["type"], "Point");
    const auto& at = one["position"]["coordinates"];
    ASSERT_TRUE(at.is_array() && at.size() >= 2 && at.size() <= 3) << at;
    for (const auto& number : at) EXPECT_TRUE(number.is_number());
    EXPECT_TRUE(one.contains("crs")) << "without it a hub takes the numbers for local ones";
  }
  static void expect_error(const api::Response& response, int status) {
    EXPECT_EQ(response.status, status) << response.body;
    const Json body = Json::parse(response.body);
    EXPECT_TRUE(body["type"].is_string());
    EXPECT_EQ(body["code"], status);
    EXPECT_TRUE(body["message"].is_string());
    EXPECT_EQ(header(response, "Content-Type"), "application/json");
  }
};

TEST(OmloxUuid, IsTheSameForTheSameThingAndOfVersionFive) {
  const auto one = to_string(api::omlox_uuid("zone", "a"));
  EXPECT_EQ(one, to_string(api::omlox_uuid("zone", "a")));
  EXPECT_NE(one, to_string(api::omlox_uuid("aircraft", "a")));
  EXPECT_EQ(one[14], '5');
  EXPECT_NE(std::string("89ab").find(one[19]), std::string::npos);
}

TEST_F(Omlox, ACalibratedFloorIsAZoneWithItsAnchorsAsControlPoints) {
  const auto site = hall(square_);
  fit(site, square_);
  const Json zone = this->zone();
  ASSERT_TRUE(parse_uuid(zone["id"].get<std::string>()).has_value());
  EXPECT_EQ(zone["type"], "uwb");
  EXPECT_EQ(zone["foreign_id"], "frame-hall-a");
  EXPECT_EQ(zone["site"], "ghent-west");
  EXPECT_EQ(zone["building"], "B1");
  EXPECT_EQ(zone["floor"], 0);
  EXPECT_EQ(zone["incomplete_configuration"], false);
  EXPECT_NEAR(zone["wgs84_height"].get<double>(), k_height_m, 1e-3) << "local z is up of the origin";
  EXPECT_EQ(zone["measurement_timestamp"].get<std::string>().size(),
            std::string("2026-05-04T10:11:12.345Z").size());
  // Pairs in turn: longitude and latitude, x and y.
  const auto& points = zone["ground_control_points"];
  ASSERT_EQ(points.size(), 8U);
  const EnuFrame enu({k_lat, k_lon, k_height_m});
  for (std::size_t i = 0; i < square_.size(); ++i) {
    const Wgs84 at = enu.wgs84_from_enu({square_[i]});
    EXPECT_NEAR(points[2 * i][0].get<double>(), at.lon_deg, 1e-9);
    EXPECT_NEAR(points[2 * i][1].get<double>(), at.lat_deg, 1e-9);
    EXPECT_NEAR(points[2 * i + 1][0].get<double>(), square_[i].x() + 1, 1e-3);
    EXPECT_NEAR(points[2 * i + 1][1].get<double>(), square_[i].y() + 2, 1e-3);
  }
  const auto& ours = zone["properties"]["anchord"];
  EXPECT_EQ(ours["revision"], 1);
  EXPECT_EQ(ours["anchors"].size(), 4U);
  EXPECT_EQ(ours["anchors"][0]["network_id"], "0x6a21");
}

TEST_F(Omlox, TheOtherDialectHasPointsAsObjectsAndListsObjects) {
  fit(hall(square_), square_);
  const Json ids = json(get("/omlox/v2/zones"));
  ASSERT_EQ(ids.size(), 1U);
  EXPECT_EQ(ids[0], zone()["id"]);
  const Json listed = json(get("/omlox/v2/zones", {{"dialect", "objects"}}));
  ASSERT_EQ(listed.size(), 1U);
  const auto& point = listed[0]["ground_control_points"][0];
  EXPECT_EQ(listed[0]["ground_control_points"].size(), 4U);
  EXPECT_EQ(point["wgs84"]["type"], "Point");
  EXPECT_NEAR(point["wgs84"]["coordinates"][0].get<double>(), k_lon, 1e-9);
  EXPECT_EQ(point["local"]["type"], "Point");
  EXPECT_NEAR(point["local"]["coordinates"][1].get<double>(), 2, 1e-3);
  expect_error(get("/omlox/v2/zones", {{"dialect", "klingon"}}), 400);
}

TEST_F(Omlox, AZoneThatAHubCannotTransformIsIncomplete) {
  const std::vector<Eigen::Vector3d> line{{0, 0, 3}, {5, 0.01, 3}, {10, 0, 6}};
  const auto site = hall(line);
  Json zone = this->zone();
  EXPECT_EQ(zone["incomplete_configuration"], true) << "no frame is fitted";
  EXPECT_TRUE(zone["ground_control_points"].empty());
  EXPECT_EQ(zone["foreign_id"], "site-" + site);
  fit(site, line);
  zone = this->zone();
  EXPECT_EQ(zone["ground_control_points"].size(), 6U);
  EXPECT_EQ(zone["incomplete_configuration"], true) << "they are on one line";
}

TEST_F(Omlox, EachFloorIsAZoneThatKeepsItsId) {
  const auto site = hall(square_);
  patch(name(3), {{"floor", "1.5"}});
  const Json all = json(get("/omlox/v2/zones/summary"));
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0]["floor"], 0);
  EXPECT_EQ(all[1]["floor"], 1.5);
  EXPECT_NE(all[0]["id"], all[1]["id"]);
  restart();
  EXPECT_EQ(json(get("/omlox/v2/zones/" + all[1]["id"].get<std::string>()))["floor"], 1.5);
  EXPECT_EQ(json(get("/omlox/v2/zones", {{"foreign_id", "site-" + site}})).size(), 2U);
  EXPECT_EQ(json(get("/omlox/v2/zones", {{"foreign_id", "none"}})).size(), 0U);
}

TEST_F(Omlox, ARetiredAnchorIsNoControlPoint) {
  fit(hall(square_), square_);
  patch(name(3), {{"retired", true}});
  EXPECT_EQ(zone()["ground_control_points"].size(), 6U);
}

TEST_F(Omlox, TransformsBetweenLocalMetresAndTheGlobe) {
  fit(hall(square_), square_);
  const auto path = "/omlox/v2/zones/" + zone()["id"].get<std::string>() + "/transform";
  const auto to_globe = put(path, {{"position", {{"type", "Point"}, {"coordinates", {11, 2, 3}}}}});
  ASSERT_EQ(to_globe.status, 200) << to_globe.body;
  const Json globe = json(to_globe);
  const Wgs84 expected = EnuFrame({k_lat, k_lon, k_height_m}).wgs84_from_enu({{10, 0, 3}});
  EXPECT_EQ(globe["crs"], "EPSG:4326");
  EXPECT_NEAR(globe["position"]["coordinates"][0].get<double>(), expected.lon_deg, 1e-8);
  EXPECT_NEAR(globe["position"]["coordinates"][1].get<double>(), expected.lat_deg, 1e-8);
  EXPECT_NEAR(globe["position"]["coordinates"][2].get<double>(), expected.height_m, 1e-3);
  const auto back = put(path, {{"position", globe["position"]}, {"crs", "EPSG:4326"}});
  ASSERT_EQ(back.status, 200) << back.body;
  EXPECT_EQ(json(back)["crs"], "local");
  EXPECT_NEAR(json(back)["position"]["coordinates"][0].get<double>(), 11, 1e-3);
  const auto flat = json(put(path, {{"position", {{"type", "Point"}, {"coordinates", {11, 2}}}}}));
  EXPECT_EQ(flat["position"]["coordinates"].size(), 2U);
  const auto feature =
      json(put(path, {{"position", globe["position"]}, {"crs", "EPSG:4326"}}, {{"geojson", "true"}}));
  EXPECT_EQ(feature["type"], "Feature");
  EXPECT_EQ(feature["geometry"]["type"], "Point");
}

TEST_F(Omlox, RefusesPositionsThatAreNone) {
  fit(hall(square_), square_);
  const auto path = "/omlox/v2/zones/" + zone()["id"].get<std::string>() + "/transform";
  const auto point = [](Json coordinates) {
    return Json{{"type", "Point"}, {"coordinates", std::move(coordinates)}};
  };
  for (const Json& body :
       {Json::object(), Json{{"position", 1}}, Json{{"position", point({1})}},
        Json{{"position", point({1, 2, 3, 4})}}, Json{{"position", point({1e300, 0})}},
        Json{{"position", point({"1", 0})}}, Json{{"position", point({200, 0})}, {"crs", "EPSG:4326"}},
        Json{{"position", point({1, 2})}, {"crs", "EPSG:3857"}},
        Json{{"position", {{"type", "LineString"}, {"coordinates", {1, 2}}}}}})
    expect_error(put(path, body), 400);
}

TEST_F(Omlox, TheTagOfAFlightIsAProviderAndItsAircraftATrackable) {
  flight();
  const Json ids = json(get("/omlox/v2/providers"));
  EXPECT_EQ(ids, Json::array({"0x6e01"})) << "one for each tag";
  const Json provider = json(get("/omlox/v2/providers/0x6e01"));
  EXPECT_EQ(provider["id"], "0x6e01");
  EXPECT_EQ(provider["type"], "uwb");
  const Json trackable = json(get("/omlox/v2/trackables/summary"))[0];
  EXPECT_TRUE(parse_uuid(trackable["id"].get<std::string>()).has_value());
  EXPECT_EQ(trackable["type"], "virtual");
  EXPECT_EQ(trackable["name"], "kit-1");
  EXPECT_EQ(trackable["location_providers"], Json::array({"0x6e01"}));
  EXPECT_EQ(json(get("/omlox/v2/trackables/" + trackable["id"].get<std::string>())), trackable);
  expect_error(get("/omlox/v2/providers/0x0001"), 404);
  expect_error(get("/omlox/v2/providers/0x6e01/location"), 404);
}

TEST_F(Omlox, ALivePositionIsALocationOfTheTag) {
  fly(flight());
  const Json location = json(get("/omlox/v2/providers/0x6e01/location"));
  expect_location(location);
  EXPECT_EQ(location["crs"], "EPSG:4326");
  EXPECT_EQ(location["elevation_ref"], "wgs84");
  EXPECT_EQ(location["timestamp_generated"], "2026-05-04T10:11:12.345Z");
  EXPECT_NEAR(location["position"]["coordinates"][0].get<double>(), k_lon, 1e-9);
  EXPECT_NEAR(location["position"]["coordinates"][2].get<double>(), 60.9, 1e-4)
      << "of the tag, below the antenna";
  EXPECT_NEAR(location["accuracy"].get<double>(), 0.05, 1e-9) << "3-4-5";
  const auto trackable = json(get("/omlox/v2/trackables"))[0].get<std::string>();
  EXPECT_EQ(location["trackables"], Json::array({trackable}));
  for (const auto& path :
       {std::string("/omlox/v2/providers/locations"), "/omlox/v2/trackables/" + trackable + "/locations"}) {
    const Json all = json(get(path));
    ASSERT_EQ(all.size(), 1U) << path;
    expect_location(all[0]);
  }
  EXPECT_EQ(json(get("/omlox/v2/trackables/" + trackable + "/location"))["provider_id"], "0x6e01");
  const Json collection = json(get("/omlox/v2/providers/locations", {{"geojson", "true"}}));
  EXPECT_EQ(collection["type"], "FeatureCollection");
  EXPECT_EQ(collection["features"][0]["geometry"]["type"], "Point");
  EXPECT_EQ(collection["features"][0]["properties"]["provider_id"], "0x6e01");
}

TEST_F(Omlox, LocalMetresAreThoseOfAZone) {
  fit(hall(square_), square_);
  fly(flight());
  const auto id = zone()["id"].get<std::string>();
  const Json local = json(get("/omlox/v2/providers/0x6e01/location", {{"crs", "local"}, {"zone_id", id}}));
  expect_location(local);
  EXPECT_EQ(local["crs"], "local");
  EXPECT_EQ(local["source"], id);
  EXPECT_NEAR(local["position"]["coordinates"][0].get<double>(), 1, 1e-3);
  EXPECT_NEAR(local["position"]["coordinates"][1].get<double>(), 2, 1e-3);
  expect_error(get("/omlox/v2/providers/locations", {{"crs", "local"}}), 400);
  expect_error(get("/omlox/v2/providers/locations", {{"crs", "EPSG:3857"}}), 400);
}

TEST_F(Omlox, RefusesInTheFormOfOmlox) {
  expect_error(get("/omlox/v2/zones/nothing"), 404);
  expect_error(get("/omlox/v2/nothing"), 404);
  expect_error(get("/omlox/v2/zones", {{"forign_id", "x"}}), 400);
  expect_error(post("/omlox/v2/zones", "{}"), 405);
  Call nobody;
  nobody.roles = {};
  expect_error(call(Method::get, "/omlox/v2/zones", "", nobody), 401);
  Call gateway;
  gateway.roles = {Role::gateway};
  expect_error(call(Method::get, "/omlox/v2/zones", "", gateway), 403);
  EXPECT_EQ(header(get("/api/v1/nothing"), "Content-Type"), "application/problem+json") << "nobody else's";
}

}  // namespace
}  // namespace anchord::test::omlox_test
