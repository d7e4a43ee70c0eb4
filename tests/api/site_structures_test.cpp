// Accepted walls and outlines of a site's floor plans, as plans of that site are checked, generated and flown
// by them.
#include <gmock/gmock.h>

#include "api/formats/floor_structure.hpp"
#include "app_fixture.hpp"
#include "core/geo/enu.hpp"

namespace anchord::test::site_structures_test {
namespace {

using ::testing::ElementsAre;

Floor floor_at(double level, std::optional<double> base_height_m = std::nullopt) {
  Floor floor;
  floor.level = level;
  floor.base_height_m = base_height_m;
  return floor;
}

TEST(StoreyHeights, ReachToTheFloorAboveThenToTheRoof) {
  Building building;
  building.height_m = 9.5;
  const std::vector<Floor> floors{floor_at(0, 0.2), floor_at(2), floor_at(1, 3.4)};
  const auto ground = storey_heights(floors[0], floors, building);
  EXPECT_DOUBLE_EQ(ground.bottom_m, 0.2);
  EXPECT_DOUBLE_EQ(ground.top_m, 3.4);
  EXPECT_DOUBLE_EQ(storey_heights(floors[2], floors, building).top_m, 6.0)
      << "3 m a level where it is not said";
  EXPECT_DOUBLE_EQ(storey_heights(floors[1], floors, building).top_m, 9.5);
  building.height_m.reset();
  EXPECT_DOUBLE_EQ(storey_heights(floors[1], floors, building).top_m, 9.0);
  building.height_m = 4;
  EXPECT_DOUBLE_EQ(storey_heights(floors[1], floors, building).top_m, 9.0)
      << "a roof below the floor is no roof";
}

TEST(FloorStructure, TakesWallsWithTheirMaterialAndOutlinesOnce) {
  constexpr auto k_text =
      R"({"outline":{"type":"Polygon","coordinates":[[[3.7,51],[3.8,51],[3.8,51.1],[3.7,51]]]},
    "walls":[{"from":[3.7,51],"to":[3.7001,51],"thickness_m":0.25,"material":"concrete"},
             {"from":[3.7,51],"to":[3.7002,51],"material":"straw"}]})";
  SiteStructure out;
  add_floor_structure(k_text, {3, 6}, out);
  add_floor_structure(k_text, {6, 9}, out);
  ASSERT_EQ(out.walls.size(), 4u);
  EXPECT_EQ(out.walls[0].material, WallMaterial::concrete);
  EXPECT_DOUBLE_EQ(out.walls[0].thickness_m, 0.25);
  EXPECT_EQ(out.walls[1].material, WallMaterial::unknown) << "a word of a later version";
  EXPECT_DOUBLE_EQ(out.walls[1].bottom_m, 3);
  EXPECT_DOUBLE_EQ(out.walls[3].top_m, 9);
  ASSERT_EQ(out.outlines.size(), 1u) << "the same on both floors";
  EXPECT_EQ(out.outlines[0].size(), 3u) << "not closed";
}

TEST(FloorStructure, LeavesOutWhatIsNoWall) {
  SiteStructure out;
  for (const char* text :
       {"", "null", "[]", R"({"outline":null,"walls":null})", R"({"outline":{},"walls":[7,{}]})",
        R"({"walls":[{"from":[3.7,51],"to":[3.7,51]}]})", R"({"walls":[{"from":[1e9,51],"to":[3.7,51]}]})",
        R"({"outline":{"coordinates":[[[3.7,51],[3.8,51],[3.7,51]]]}})"})
    add_floor_structure(text, {0, 3}, out);
  EXPECT_TRUE(out.walls.empty());
  EXPECT_TRUE(out.outlines.empty());
}

TEST(FloorStructure, KeepsTheLongestWallsOfMore) {
  SiteStructure out;
  for (const double length_deg : {3e-5, 1e-5, 4e-5, 2e-5})
    out.walls.push_back({{3.7, 51}, {3.7 + length_deg, 51}, 0, 3});
  keep_longest(out, 2);
  std::vector<double> kept;
  for (const auto& wall : out.walls) kept.push_back(std::round((wall.to.lon_deg - 3.7) * 1e5));
  EXPECT_THAT(kept, ::testing::UnorderedElementsAre(3, 4));
}

class SiteWalls : public AppFixture {
 protected:
  void SetUp() override {
    AppFixture::SetUp();
    site_ =
        created("/api/v1/sites", {{"name", "ghent"}, {"origin", {{"lon", 3.7}, {"lat", 51}, {"h_m", 50}}}});
    const auto building = created("/api/v1/buildings", {{"name", "B1"}, {"height_m", 6}, {"site", site_}});
    floor_ = "/api/v1/floors/" +
             created("/api/v1/floors", {{"name", "Ground"}, {"level", 0}, {"building", building}});
  }
  std::string created(const std::string& path, const Json& body) {
    const auto made = post(path, body.dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made)["id"];
  }
  static Json at(double east_m, double north_m) {
    const auto p = EnuFrame({51, 3.7, 50}).wgs84_from_enu(Enu{{east_m, north_m, 0}});
    return {p.lon_deg, p.lat_deg};
  }
  /// 20 x 10 m, from 0, 0.
  static Json outline() {
    return {
        {"type", "Polygon"},
        {"coordinates", Json::array({Json::array({at(0, 0), at(20, 0), at(20, 10), at(0, 10), at(0, 0)})})}};
  }
  void accept(const Json& structure) {
    Call options;
    options.headers["if-match"] = header(get(floor_), "ETag");
    const auto put = call(api::Method::put, floor_ + "/walls", structure.dump(), options);
    ASSERT_EQ(put.status, 200) << put.body;
  }
  /// Waypoints west of the building, in it and south of it.
  Json plan() const {
    Json out{{"name", "drawn"}, {"site", site_}, {"waypoints", Json::array()}};
    for (const auto& p : {at(-10, 5), at(10, 5), at(10, -10)})
      out["waypoints"].push_back({{"lon", p[0]}, {"lat", p[1]}, {"height_above_ground_m", 3}});
    return out;
  }
  std::vector<std::string> errors_of(const Json& plan) {
    const auto got = post("/api/v1/plans/validate", plan.dump());
    EXPECT_EQ(got.status, 200) << got.body;
    std::vector<std::string> out;
    for (const auto& issue : Json(json(got)["issues"]))
      if (issue["severity"] == "error") out.push_back(issue["code"]);
    return out;
  }
  std::string site_, floor_;
};

TEST_F(SiteWalls, KeepPlansOfTheirSiteOutOfAnAcceptedBuildingAtOnce) {
  EXPECT_TRUE(errors_of(plan()).empty()) << "nothing is accepted yet";
  accept({{"outline", outline()}});
  EXPECT_THAT(errors_of(plan()), ElementsAre("no_fly"));
  auto elsewhere = plan();
  elsewhere.erase("site");
  EXPECT_TRUE(errors_of(elsewhere).empty()) << "a plan of no site";
  accept({{"outline", nullptr}});
  EXPECT_TRUE(errors_of(plan()).empty()) << "taken back";
}

TEST_F(SiteWalls, AreThoseOfTodayOnTheChecklistOfAFlight) {
  const auto id = created("/api/v1/plans", plan());
  const auto path = "/api/v1/missions/" + mission() + "/checklist";
  const auto plan_item = [&] {
    for (const auto& item : Json(json(get(path, {{"plan", id}}))["items"]))
      if (item["id"] == "plan") return item["state"].get<std::string>();
    return std::string("missing");
  };
  EXPECT_EQ(plan_item(), "ok");
  accept({{"outline", outline()}});
  EXPECT_EQ(plan_item(), "failed") << "the same revision of the plan, checked anew";
}

// A front of concrete in place of one of unknown make: (sqrt(5.2) - 1) x 0.3 m = 0.384 m, taken as 0.2 m
// before.
TEST_F(SiteWalls, MakeThePredictedErrorThatOfTheirMaterial) {
  Json drawn{{"name", "hall"}, {"site", site_}, {"outline", outline()}, {"building_height_m", 6}};
  const auto made = json(post("/api/v1/plans/generate", drawn.dump()))["plan"];
  const auto predicted_m = [&] {
    return json(post("/api/v1/plans/validate", made.dump()))["predicted"]["rms_m"].get<double>();
  };
  const double unknown_m = predicted_m();
  const auto fronts = [&](const char* material) {
    Json walls = Json::array();
    const std::vector<Json> corners{at(0.15, 0.15), at(19.85, 0.15), at(19.85, 9.85), at(0.15, 9.85)};
    for (std::size_t i = 0; i < 4; ++i)
      walls.push_back(
          {{"from", corners[i]}, {"to", corners[(i + 1) % 4]}, {"thickness_m", 0.3}, {"material", material}});
    return Json{{"outline", outline()}, {"walls", walls}};
  };
  accept(fronts("concrete"));
  const double concrete_m = predicted_m();
  accept(fronts("plasterboard"));
  const double board_m = predicted_m();
  EXPECT_GT(concrete_m, unknown_m);
  EXPECT_LT(board_m, concrete_m);
  accept(fronts("metal"));
  EXPECT_GT(predicted_m(), 10) << "nothing gets through: no anchor can be placed from outside";
}

}  // namespace
}  // namespace anchord::test::site_structures_test
