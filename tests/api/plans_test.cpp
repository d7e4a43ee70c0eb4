#include <cmath>

#include <set>

#include <gmock/gmock.h>
#include <Eigen/Dense>

#include "app_fixture.hpp"

namespace anchord::test::plans_test {
namespace {

/// A 30 x 20 m hall: at 51 degrees a degree of longitude has 70.2 km, one of latitude 111.2 km.
Json hall() {
  return Json::parse(R"({"name":"Hall A","building_height_m":8,
    "outline":{"type":"Polygon","coordinates":[[[3.7131,51.0231],[3.7135275,51.0231],[3.7135275,51.0232799],[3.7131,51.0232799],[3.7131,51.0231]]]},
    "settings":{"keep_out_m":4,"max_height_m":20},
    "waypoints":[{"lon":3.71300,"lat":51.02305,"height_above_ground_m":4,"turn":true,"dwell_s":6},
                 {"lon":3.71362,"lat":51.02305,"height_above_ground_m":9,"heading_deg":90},
                 {"lon":3.71362,"lat":51.02334,"height_above_ground_m":4},
                 {"lon":3.71300,"lat":51.02334,"height_above_ground_m":12,"measure":false}]})");
}

class Plans : public AppFixture {
 protected:
  Json make(const Json& body) {
    const auto made = post("/api/v1/plans", body.dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made);
  }
  api::Response with_match(api::Method method, const std::string& path, const std::string& body,
                           const std::string& etag) {
    Call options;
    options.headers["if-match"] = etag;
    return call(method, path, body, options);
  }
};

TEST_F(Plans, AreStoredAndComeBackAsTheyWere) {
  const Json made = make(hall());
  EXPECT_EQ(made["revision"], 1);
  const auto path = "/api/v1/plans/" + made["id"].get<std::string>();
  restart();
  const auto got = get(path);
  EXPECT_EQ(got.status, 200);
  EXPECT_EQ(json(got), made);
  EXPECT_EQ(made["waypoints"][0]["turn"], true);
  EXPECT_EQ(made["settings"]["keep_out_m"], 4);
  EXPECT_EQ(made["settings"]["k"], 3) << "what was not said has its default";
  EXPECT_EQ(json(get("/api/v1/plans"))["items"].size(), 1u);
}

// RFC 9110, 13.1.1.
TEST_F(Plans, AreChangedWhereOneOfAListOfETagsIsTheirs) {
  const auto path = "/api/v1/plans/" + make(hall())["id"].get<std::string>();
  const auto patch = [&](const std::string& tags) {
    Call options;
    options.type = "application/merge-patch+json";
    options.headers["if-match"] = tags;
    return call(api::Method::patch, path, R"({"name":"Hall B"})", options).status;
  };
  for (const auto* none : {R"("x", "y")", R"(W/"p-1")", R"("p-11")", R"("x\"p-1\"y")", "p-1", R"("p-1)"})
    EXPECT_EQ(patch(none), 412) << none;
  EXPECT_EQ(patch(R"("x", "p-1")"), 200);
  EXPECT_EQ(patch(R"("p-2","x")"), 200);
  EXPECT_EQ(patch(R"(W/"x" , "p-3")"), 200);
  EXPECT_EQ(patch("*"), 200);
}

TEST_F(Plans, WhatWasGotCanBePutBack) {
  Json plan = make(hall());
  const auto path = "/api/v1/plans/" + plan["id"].get<std::string>();
  plan["name"] = "Hall B";
  const auto put = with_match(api::Method::put, path, plan.dump(), "\"p-1\"");
  ASSERT_EQ(put.status, 200) << put.body;
  EXPECT_EQ(json(put)["revision"], 2);
  EXPECT_EQ(header(put, "ETag"), "\"p-2\"");
  EXPECT_EQ(json(get(path))["name"], "Hall B");
}

TEST_F(Plans, AChangeOfAnOldRevisionIsRefused) {
  const Json plan = make(hall());
  const auto path = "/api/v1/plans/" + plan["id"].get<std::string>();
  EXPECT_EQ(with_match(api::Method::patch, path, R"({"settings":{"k":5}})", "\"p-1\"").status, 200);
  EXPECT_EQ(with_match(api::Method::patch, path, R"({"settings":{"k":6}})", "\"p-1\"").status, 412);
  EXPECT_EQ(json(get(path))["settings"]["k"], 5);
  EXPECT_EQ(json(get(path))["settings"]["keep_out_m"], 4) << "a merge-patch leaves the rest";
  EXPECT_EQ(with_match(api::Method::del, path, "", "\"p-1\"").status, 412);
  EXPECT_EQ(with_match(api::Method::del, path, "", "\"p-2\"").status, 204);
  EXPECT_EQ(get(path).status, 404);
}

TEST_F(Plans, EverythingWrongIsNamedAtOnce) {
  Json plan = hall();
  plan["waypoints"][1]["height_above_ground_m"] = -4;
  plan["settings"]["speed"] = 3;
  plan["outline"]["type"] = "Point";
  plan["anchor_targets"] = Json::parse(R"([{"network_id":"0x6a21","target_sigma_m":0.02},
    {"network_id":"0x6a21","target_sigma_m":0.03},{"network_id":"left","target_sigma_m":0.03},
    {"network_id":"0x6a22","target_sigma_m":0},{"network_id":"0x6a23"}])");
  const auto answer = post("/api/v1/plans", plan.dump());
  ASSERT_EQ(answer.status, 422);
  std::set<std::string> pointers;
  const Json problem = json(answer);
  for (const auto& e : problem["errors"]) pointers.insert(e["pointer"]);
  EXPECT_TRUE(pointers.count("/waypoints/1/height_above_ground_m")) << answer.body;
  EXPECT_TRUE(pointers.count("/settings/speed")) << answer.body;
  EXPECT_TRUE(pointers.count("/outline")) << answer.body;
  for (const char* where : {"1/network_id", "2/network_id", "3/target_sigma_m", "4/target_sigma_m"})
    EXPECT_TRUE(pointers.count(std::string("/anchor_targets/") + where)) << answer.body;
}

TEST_F(Plans, ValidateTellsWhatIsWrongAndWhatTheFlightWouldBring) {
  Json plan = hall();
  plan["waypoints"][1]["lon"] = 3.7133;  // above the building's south wall, 5.6 m south of it: still legal
  plan["waypoints"][2] = {
      {"lon", 3.7133}, {"lat", 51.0232}, {"height_above_ground_m", 4}};  // inside the hall
  plan["waypoints"][3]["height_above_ground_m"] = 25;
  const auto made = make(plan);
  const auto check = json(post("/api/v1/plans/" + made["id"].get<std::string>() + "/validate", ""));
  EXPECT_EQ(check["flyable"], false);
  std::map<std::string, std::string> issues;
  for (const auto& issue : check["issues"]) issues[issue["pointer"].get<std::string>()] = issue["code"];
  EXPECT_EQ(issues["/waypoints/2"], "no_fly");
  EXPECT_EQ(issues["/waypoints/3"], "too_high");
  EXPECT_EQ(issues.count("/waypoints/0"), 0u);
  EXPECT_EQ(check["n_measure"], 3);
  EXPECT_GT(check["predicted"]["worst_m"], 0);
}

TEST_F(Plans, ADrawnPlanIsJudgedAsAStoredOneAndNothingIsStored) {
  Json plan = hall();
  plan["waypoints"][3]["measure"] = true;
  const auto drawn = post("/api/v1/plans/validate", plan.dump());
  ASSERT_EQ(drawn.status, 200) << drawn.body;
  EXPECT_EQ(json(get("/api/v1/plans"))["items"].size(), 0u);
  const auto made = make(plan);
  EXPECT_EQ(json(drawn), json(post("/api/v1/plans/" + made["id"].get<std::string>() + "/validate", "")));
  // Four measuring points, by hand: rows of unit vectors in metres about the middle of the hall.
  const Json seen = json(drawn)["predicted"]["anchors"][0];
  const Eigen::Vector3d anchor(seen["enu_m"][0], seen["enu_m"][1], seen["enu_m"][2]);
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  for (int i = 0; i < 4; ++i) {
    const auto& w = plan["waypoints"][static_cast<std::size_t>(i)];
    const Eigen::Vector3d point((w["lon"].get<double>() - 3.71331375) * 70'200,
                                (w["lat"].get<double>() - 51.02318995) * 111'200,
                                w["height_above_ground_m"].get<double>());
    const Eigen::Vector3d u = (point - anchor).normalized();
    normal += u * u.transpose();
  }
  const double gdop = std::sqrt(normal.inverse().trace());
  EXPECT_NEAR(seen["gdop"].get<double>(), gdop, 0.01 * gdop);  // degrees to metres by three digits
  EXPECT_EQ(post("/api/v1/plans/validate", R"({"name":"x","outlin":null})").status, 422);
}

// One corner at 0, 0: it kept a worker busy for minutes, as a grid of places inside was made first.
TEST_F(Plans, WithACornerOnAnotherContinentIsJudgedAtOnceAndNotFlyable) {
  Json drawn = hall();
  drawn["outline"]["coordinates"][0][1] = {0, 0};
  const auto checked = post("/api/v1/plans/validate", drawn.dump());
  ASSERT_EQ(checked.status, 200) << checked.body;
  EXPECT_FALSE(json(checked)["flyable"].get<bool>());
  const auto issues = json(checked)["issues"];
  const auto far =
      std::find_if(issues.begin(), issues.end(), [](const Json& i) { return i["code"] == "too_far"; });
  ASSERT_NE(far, issues.end()) << issues;
  EXPECT_EQ((*far)["pointer"], "/outline");
  EXPECT_THAT((*far)["text"].get<std::string>(), ::testing::HasSubstr("limit is 2000 m"));
}

TEST_F(Plans, AreWarnedOfWaypointsAtTheFenceOfOneHeightAndOfPlacesOutOfRange) {
  const auto codes = [&](const Json& plan) {
    std::map<std::string, std::string> out;
    const auto check = json(post("/api/v1/plans/validate", plan.dump()));
    for (const auto& i : check["issues"]) out[i["code"]] = i["text"];
    return out;
  };
  Json plan = hall();
  plan["fence"] = Json::parse(
      R"({"type":"Polygon","coordinates":[[[3.712,51.02301],[3.715,51.02301],[3.715,51.0242],[3.712,51.0242]]]})");
  EXPECT_EQ(codes(plan).count("near_fence"), 0u);  // 4.4 m inside: 0.00004 degrees of latitude
  plan["fence"]["coordinates"][0][0][1] = plan["fence"]["coordinates"][0][1][1] = 51.023045;  // 0.56 m
  EXPECT_THAT(codes(plan)["near_fence"], ::testing::HasSubstr("waypoint 1, 2"));
  EXPECT_EQ(codes(plan).count("one_height"), 0u);
  for (auto& w : plan["waypoints"]) w["height_above_ground_m"] = 4;
  plan["waypoints"][3]["measure"] = true;
  EXPECT_EQ(codes(plan).count("one_height"), 1u);
  EXPECT_EQ(codes(plan).count("over_range"), 0u);
  // 300 m long: its east end is out of the 60 m of a tag from all four.
  for (int i : {1, 2}) plan["outline"]["coordinates"][0][static_cast<std::size_t>(i)][0] = 3.7174;
  plan["waypoints"].erase(1);
  plan["waypoints"].erase(1);
  for (int i : {0, 1}) {
    plan["waypoints"].push_back(plan["waypoints"][static_cast<std::size_t>(i)]);
    plan["waypoints"].back()["height_above_ground_m"] = 8;
  }
  EXPECT_EQ(codes(plan).count("over_range"), 1u);
  const auto predicted = json(post("/api/v1/plans/validate", plan.dump()))["predicted"];
  EXPECT_GT(predicted["n_out_of_range"], 0);
  EXPECT_LT(predicted["worst_m"], 30) << "a place that is not measured is not a bad estimate";
}

TEST_F(Plans, WhoseOutlineCrossesItselfAreNotFlownAndHaveNoWaypointsMade) {
  Json plan = hall();
  std::swap(plan["outline"]["coordinates"][0][1], plan["outline"]["coordinates"][0][2]);
  const auto check = json(post("/api/v1/plans/validate", plan.dump()));
  EXPECT_EQ(check["flyable"], false);
  EXPECT_EQ(check["issues"][1]["code"], "self_crossing") << check["issues"];
  EXPECT_EQ(check["issues"][1]["pointer"], "/outline");
  const auto made = post("/api/v1/plans/generate", plan.dump());
  EXPECT_EQ(made.status, 422);
  EXPECT_THAT(made.body, ::testing::HasSubstr("crosses itself"));
}

TEST_F(Plans, GenerateFliesRoundTheOutlineWithoutAnyWaypointSet) {
  Json plan = hall();
  plan.erase("waypoints");
  const auto answer = post("/api/v1/plans/generate", plan.dump());
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Json out = json(answer);
  EXPECT_EQ(out["check"]["flyable"], true) << out["check"]["issues"].dump();
  EXPECT_GE(out["plan"]["waypoints"].size(), 8u);
  EXPECT_LT(out["check"]["predicted"]["rms_m"], 0.3);
  const auto made = post("/api/v1/plans", out["plan"].dump());
  EXPECT_EQ(made.status, 201) << "what was generated can be stored: " << made.body;
  plan.erase("outline");
  EXPECT_EQ(post("/api/v1/plans/generate", plan.dump()).status, 422);
}

TEST_F(Plans, ExportedForQGroundControlAndImportedAgainTheyFlyTheSame) {
  Json plan = hall();
  plan["fence"] = Json::parse(
      R"({"type":"Polygon","coordinates":[[[3.712,51.022],[3.715,51.022],[3.715,51.0242],[3.712,51.0242]]]})");
  const Json made = make(plan);
  const auto file = get("/api/v1/plans/" + made["id"].get<std::string>() + "/export");
  ASSERT_EQ(file.status, 200);
  const Json qgc = json(file);
  EXPECT_EQ(qgc["fileType"], "Plan");
  EXPECT_EQ(qgc["mission"]["items"][0]["command"], 22);
  const auto imported = post("/api/v1/plans/import", file.body, "application/json", {{"name", "Again"}});
  ASSERT_EQ(imported.status, 201) << imported.body;
  const Json again = json(imported);
  EXPECT_EQ(again["name"], "Again");
  ASSERT_EQ(again["waypoints"].size(), made["waypoints"].size());
  for (std::size_t i = 0; i < made["waypoints"].size(); ++i) {
    for (const char* key : {"lon", "lat", "height_above_ground_m", "measure", "turn"}) {
      EXPECT_EQ(again["waypoints"][i][key], made["waypoints"][i][key]) << i << key;
    }
  }
  EXPECT_EQ(again["fence"], made["fence"]);
  // QGroundControl has no building: its outline comes back as an area not to fly in.
  EXPECT_EQ(again["no_fly"][0], made["outline"]);
}

TEST_F(Plans, ReadAPlanAsQGroundControlWritesIt) {
  // Items of the .plan example in QGroundControl's developer guide (file_formats/plan.md), shortened.
  const char* file =
      R"({"fileType":"Plan","geoFence":{"circles":[{"circle":{"center":[47.397,8.5456],"radius":100},
    "inclusion":true,"version":1}],"polygons":[{"inclusion":false,"polygon":[[47.3977,8.5456],[47.3977,8.5459],[47.3979,8.5459]],
    "version":1}],"version":2},"groundStation":"QGroundControl","mission":{"cruiseSpeed":15,"firmwareType":12,"hoverSpeed":5,
    "items":[{"AMSLAltAboveTerrain":null,"Altitude":50,"AltitudeMode":1,"autoContinue":true,"command":22,"doJumpId":1,"frame":3,
    "params":[15,0,0,null,47.3985099,8.5451002,50],"type":"SimpleItem"},
    {"autoContinue":true,"command":16,"doJumpId":2,"frame":3,"params":[2,0,0,-90,47.3985099,8.5451002,20],"type":"SimpleItem"},
    {"TransectStyleComplexItem":{},"complexItemType":"survey","type":"ComplexItem","version":4},
    {"autoContinue":true,"command":20,"doJumpId":4,"frame":2,"params":[0,0,0,0,0,0,0],"type":"SimpleItem"}],
    "plannedHomePosition":[47.3977419,8.545594,487.989],"vehicleType":2,"version":2},
    "rallyPoints":{"points":[],"version":2},"version":1})";
  const auto answer = post("/api/v1/plans/import", file, "application/json", {{"dry_run", "true"}});
  ASSERT_EQ(answer.status, 200) << answer.body;
  const Json out = json(answer);
  ASSERT_EQ(out["plan"]["waypoints"].size(), 1u);
  EXPECT_EQ(out["plan"]["waypoints"][0]["heading_deg"], 270);
  EXPECT_EQ(out["plan"]["settings"]["speed_mps"], 5);
  EXPECT_EQ(out["plan"]["fence"]["coordinates"][0].size(), 25u);
  EXPECT_EQ(out["plan"]["no_fly"].size(), 1u);
  EXPECT_EQ(out["notes"].size(), 1u) << "the survey was left out and said so";
  EXPECT_EQ(json(get("/api/v1/plans"))["items"].size(), 0u) << "a dry run stores nothing";
}

// As Google Earth writes it, shortened.
const std::string k_kml = R"(<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Document>
 <name>Site.kml</name><Style id="s"><LineStyle><color>ff0000ff</color></LineStyle></Style>
 <!-- drawn by hand -->
 <Placemark><name>Hall &amp; store</name><Polygon><tessellate>1</tessellate><outerBoundaryIs><LinearRing><coordinates>
  3.7131,51.0231,0 3.7135275,51.0231,0 3.7135275,51.0232799,0 3.7131,51.0232799,0 3.7131,51.0231,0
 </coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
 <Folder><name>No fly</name><Placemark><name>Pond</name><Polygon><outerBoundaryIs><LinearRing>
  <coordinates>3.7140,51.0231 3.7142,51.0231 3.7142,51.0233</coordinates></LinearRing></outerBoundaryIs>
  <innerBoundaryIs/></Polygon></Placemark></Folder>
 <Placemark><name>Area</name><ExtendedData><Data name="kind"><value>fence</value></Data></ExtendedData><Polygon>
  <outerBoundaryIs><LinearRing><coordinates>3.712,51.022 3.715,51.022 3.715,51.0242 3.712,51.0242</coordinates></LinearRing>
  </outerBoundaryIs></Polygon></Placemark>
 <Placemark><name><![CDATA[P1]]></name><Point><altitudeMode>relativeToGround</altitudeMode>
  <coordinates>3.7130,51.02305,4.5</coordinates></Point></Placemark>
 <Placemark><LineString><altitudeMode>relativeToGround</altitudeMode><coordinates>3.7129,51.0230,3
  3.7136,51.0230,9</coordinates></LineString></Placemark>
 <NetworkLink><name>elsewhere</name></NetworkLink>
</Document></kml>)";
const char* const k_kml_type = "application/vnd.google-earth.kml+xml";

TEST_F(Plans, ReadOutlineAreasAndWaypointsOfKml) {
  const auto answer = post("/api/v1/plans/import", k_kml, k_kml_type, {{"name", "From the map"}});
  ASSERT_EQ(answer.status, 201) << answer.body;
  const Json plan = json(answer);
  EXPECT_EQ(plan["name"], "From the map");
  ASSERT_EQ(plan["outline"]["coordinates"][0].size(), 5u) << "closed as GeoJSON wants it";
  EXPECT_EQ(plan["outline"]["coordinates"][0][1][0], 3.7135275);
  ASSERT_EQ(plan["no_fly"].size(), 1u);
  EXPECT_EQ(plan["fence"]["coordinates"][0].size(), 5u);
  ASSERT_EQ(plan["waypoints"].size(), 3u);
  EXPECT_EQ(plan["waypoints"][0]["height_above_ground_m"], 4.5);
  EXPECT_EQ(plan["waypoints"][2]["lat"], 51.0230);
  const auto dry = post("/api/v1/plans/import", k_kml, k_kml_type, {{"dry_run", "true"}});
  EXPECT_EQ(json(dry)["notes"].size(), 2u) << dry.body;
}

TEST_F(Plans, TellWhatIsWrongWithKml) {
  const auto wrong = [&](const std::string& inside) {
    const auto answer = post("/api/v1/plans/import",
                             "<kml><Placemark><name>X</name>" + inside + "</Placemark></kml>", k_kml_type);
    EXPECT_EQ(answer.status, 422) << answer.body;
    return answer.body;
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(wrong("<Point><coordinates>3.7,51</coordinates></Point>"), HasSubstr("relativeToGround"));
  EXPECT_THAT(
      wrong("<Point><altitudeMode>absolute</altitudeMode><coordinates>3.7,51,60</coordinates></Point>"),
      HasSubstr("above sea level"));
  EXPECT_THAT(
      wrong("<Polygon><outerBoundaryIs><LinearRing><coordinates>51.02;3.7 4,5 6,7</coordinates></LinearRing>"
            "</outerBoundaryIs></Polygon>"),
      HasSubstr("51.02;3.7"));
  EXPECT_THAT(wrong("<Polygon><outerBoundaryIs><LinearRing><coordinates>3,51 4,51</coordinates></LinearRing>"
                    "</outerBoundaryIs></Polygon>"),
              HasSubstr("3 different corners"));
  EXPECT_THAT(wrong("<Point><altitudeMode>relativeToGround</altitudeMode><coordinates>3.7,51,900</"
                    "coordinates></Point>"),
              HasSubstr("0 to 500 m"));
  const auto broken = [&](const std::string& text) {
    return post("/api/v1/plans/import", text, k_kml_type).body;
  };
  EXPECT_THAT(broken("<kml>\n<Placemark></kml>"), HasSubstr("line 2"));
  EXPECT_THAT(broken("<!DOCTYPE kml [<!ENTITY a 'b'>]><kml/>"), HasSubstr("document type"));
  EXPECT_THAT(broken("<gpx/>"), HasSubstr("not kml"));
  EXPECT_THAT(broken("<kml><Document/></kml>"), HasSubstr("it contains no drawing"));
  EXPECT_THAT(broken(std::string("PK\x03\x04", 4)), HasSubstr("unpack"));
}

TEST_F(Plans, OnlyAnOperatorMayChangeThem) {
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(api::Method::post, "/api/v1/plans", hall().dump(), viewer).status, 403);
  EXPECT_EQ(call(api::Method::get, "/api/v1/plans", "", viewer).status, 200);
}

}  // namespace
}  // namespace anchord::test::plans_test
