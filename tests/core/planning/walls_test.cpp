// What walls do to a range, by hand: delay (sqrt(permittivity) - 1) x thickness, loss in dB, both by the
// inverse cosine of the incidence.
#include "core/planning/walls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/geo/enu.hpp"
#include "core/planning/design.hpp"
#include "core/planning/local_plan.hpp"
#include "core/planning/next_point.hpp"

namespace anchord::planning::walls_test {
namespace {

using Eigen::Vector3d;

/// Across the x axis at `x_m`, from y = -5 to 5, 0 to 3 m high.
BuiltWall wall_at(double x_m, double thickness_m, WallMaterial material) {
  return {{x_m, -5}, {x_m, 5}, 0, 3, thickness_m, material};
}
const BuiltWall k_concrete = wall_at(2, 0.2, WallMaterial::concrete),
                k_brick = wall_at(4, 0.1, WallMaterial::brick);

// sqrt(5.2) = 2.2803509, sqrt(3.9) = 1.9748418.
constexpr double k_concrete_m = 1.2803509 * 0.2, k_brick_m = 0.9748418 * 0.1;

TEST(Walls, AddTheirDelaysAndLossesWhereARayCrossesTwo) {
  const auto through = obstruction_between(std::vector{k_concrete, k_brick}, {0, 0, 1}, {6, 0, 1});
  EXPECT_EQ(through.n, 2u);
  EXPECT_NEAR(through.excess_m, k_concrete_m + k_brick_m, 1e-7);
  EXPECT_NEAR(through.loss_db, 14.0 + 7.0, 1e-12);
  EXPECT_NEAR(p_nlos_of_loss(through.loss_db), 1 - std::pow(10, -2.1), 1e-12);
}

TEST(Walls, AreMetInTheOrderOfTheWay) {
  const auto hits = hits_between(std::vector{k_brick, k_concrete}, {6, 0, 1}, {0, 0, 1});
  ASSERT_EQ(hits.size(), 2u);
  EXPECT_NEAR(hits[0].share, 2.0 / 6, 1e-12) << "brick, at x = 4 seen from 6";
  EXPECT_NEAR(hits[1].share, 4.0 / 6, 1e-12);
}

// 60 degrees from the normal: twice the wall. 45 degrees up: sqrt(2) of it.
TEST(Walls, AreThickerForARayAtAnAngle) {
  const double y_m = 4 * std::sqrt(3.0);
  const auto aslant = obstruction_between(std::vector{k_concrete}, {0, -y_m / 2, 1}, {4, y_m / 2, 1});
  EXPECT_NEAR(aslant.excess_m, 2 * k_concrete_m, 1e-7);
  EXPECT_NEAR(aslant.loss_db, 28, 1e-9);
  const auto upwards = obstruction_between(std::vector{k_concrete}, {1, 0, 1}, {3, 0, 3});
  EXPECT_NEAR(upwards.excess_m, std::sqrt(2.0) * k_concrete_m, 1e-7);
}

// 1 in 10 off the wall: cos = 0.0995, which would be ten walls.
TEST(Walls, AreNeverMoreThanFiveForAGrazingRay) {
  const auto grazing = obstruction_between(std::vector{k_concrete}, {1.8, -2, 1}, {2.2, 2, 1});
  EXPECT_NEAR(grazing.loss_db, 5 * 14.0, 1e-9);
}

TEST(Walls, AreNotMetByARayParallelToThem) {
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {1, -9, 1}, {1, 9, 1}).n, 0u) << "beside it";
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {2, -9, 1}, {2, 9, 1}).n, 0u) << "within it";
}

TEST(Walls, CountWhereARayTouchesAnEndAndNotBesideIt) {
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 5, 1}, {6, 5, 1}).n, 1u);
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 5.001, 1}, {6, 5.001, 1}).n, 0u);
  const BuiltWall turned{k_concrete.to_m, k_concrete.from_m, 0, 3, 0.2, WallMaterial::concrete};
  EXPECT_EQ(obstruction_between(std::vector{turned}, {0, 5, 1}, {6, 5, 1}).n, 1u)
      << "whichever end is named first";
}

TEST(Walls, DoNotStandInTheWayOfARayThatBeginsOrEndsOnThem) {
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {2, 0, 1}, {6, 0, 1}).n, 0u);
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 0, 1}, {2, 0, 1}).n, 0u);
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 0, 1}, {1.9, 0, 1}).n, 0u) << "short of it";
}

TEST(Walls, AreMissedByARayAboveOrBelowThem) {
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 0, 4}, {6, 0, 4}).n, 0u);
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 0, -1}, {6, 0, -1}).n, 0u);
  // 4 m high where it begins and 1 m where it ends: at x = 2 it is 3 m, the upper edge, then 3.01.
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 0, 4}, {6, 0, 1}).n, 1u);
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {0, 0, 4.01}, {6, 0, 1.01}).n, 0u);
}

TEST(Walls, WithoutALengthOrARayWithoutOneMeetNothing) {
  const BuiltWall point{{2, 0}, {2, 0}, 0, 3, 0.2, WallMaterial::concrete};
  EXPECT_EQ(obstruction_between(std::vector{point}, {0, 0, 1}, {6, 0, 1}).n, 0u);
  EXPECT_EQ(obstruction_between(std::vector{k_concrete}, {2, 0, 1}, {2, 0, 1}).n, 0u);
  EXPECT_EQ(obstruction_between({}, {0, 0, 1}, {6, 0, 1}).n, 0u);
}

TEST(Walls, OfUnknownMakeAreTakenAsBrickAndMetalIsOpaque) {
  EXPECT_EQ(properties_of(WallMaterial::unknown).loss_db, properties_of(WallMaterial::brick).loss_db);
  const auto metal =
      obstruction_between(std::vector{wall_at(2, 0.01, WallMaterial::metal)}, {0, 0, 1}, {6, 0, 1});
  EXPECT_NEAR(p_nlos_of_loss(metal.loss_db), 1 - 1e-6, 1e-12);
}

// Two panes of 6 mm and two boards of 12.5 mm: sqrt(6.3) = 2.5099801, sqrt(2.7) = 1.6431677.
TEST(Walls, OfGlassAndPlasterboardAreMostlyAir) {
  const auto drawn = [](double thickness_m, WallMaterial material) {
    return obstruction_between(std::vector{wall_at(2, thickness_m, material)}, {0, 0, 1}, {6, 0, 1}).excess_m;
  };
  EXPECT_NEAR(drawn(0.1, WallMaterial::glass), 1.5099801 * 0.012, 1e-9);
  EXPECT_NEAR(drawn(0.01, WallMaterial::glass), 1.5099801 * 0.010, 1e-9) << "one pane";
  EXPECT_NEAR(drawn(0.1, WallMaterial::plasterboard), 0.6431677 * 0.025, 1e-9);
}

TEST(Walls, AreIndependentInTheirProbabilities) {
  const double one = p_nlos_of_loss(7), other = p_nlos_of_loss(1.5);
  EXPECT_NEAR(p_nlos_of_loss(8.5), 1 - (1 - one) * (1 - other), 1e-12);
  EXPECT_EQ(p_nlos_of_loss(0), 0);
}

/// An anchor 10 m north of the aircraft and a wall before one of two candidates that are each other's mirror.
struct Mirrored {
  NextPointInput input;
  NextPointOptions options;
  Mirrored() {
    input.visited = {{0, 0, 1}};
    input.anchors = {{"a", {{{0, 10, 1}, 1}}, {0}}};
    options.rule = Rule::a_optimal;
    options.grid.step_m = 3;
  }
  CandidateValue at(const Decision& decision, double x, double y, double z) const {
    for (const auto& c : decision.candidates)
      if ((c.point_m - Vector3d(x, y, z)).norm() < 1e-9) return c;
    ADD_FAILURE() << "no candidate at " << x << ' ' << y;
    return decision.candidates[0];
  }
};

// From (3, 0) the ray meets y = 5 at x = 1.5, from (-3, 0) at -1.5. Its cosine there is 10 / sqrt(109).
TEST(NextPoint, ExpectsNoLineOfSightThroughAnAcceptedWall) {
  Mirrored made;
  made.input.walls = std::make_shared<std::vector<BuiltWall>>(
      std::vector<BuiltWall>{{{1, 5}, {9, 5}, 0, 3, 0.1, WallMaterial::brick}});
  const auto decision = next_point(made.input, made.options).value();
  const auto& behind = made.at(decision, 3, 0, 1);
  const auto& open = made.at(decision, -3, 0, 1);
  EXPECT_NEAR(behind.p_nlos, 1 - std::pow(10, -0.7 * std::sqrt(109.0) / 10), 1e-9);
  EXPECT_EQ(open.p_nlos, 0);
  EXPECT_GT(behind.value, open.value) << "a range that is late tells less";
}

TEST(NextPoint, SeesOverAWallThatIsLowerThanTheRay) {
  Mirrored made;
  made.input.walls = std::make_shared<std::vector<BuiltWall>>(
      std::vector<BuiltWall>{{{-9, 5}, {9, 5}, 0, 0.9, 0.1, WallMaterial::brick}});
  const auto decision = next_point(made.input, made.options).value();
  EXPECT_EQ(made.at(decision, 3, 0, 1).p_nlos, 0);
}

TEST(NextPoint, ExpectsNothingOfACandidateBehindMetal) {
  Mirrored made;
  made.input.walls = std::make_shared<std::vector<BuiltWall>>(
      std::vector<BuiltWall>{{{1, 5}, {9, 5}, 0, 3, 0.01, WallMaterial::metal}});
  const auto decision = next_point(made.input, made.options).value();
  EXPECT_EQ(made.at(decision, 3, 0, 1).value, decision.value_before);
  EXPECT_EQ(made.at(decision, 3, 0, 1).p_nlos, 1);
}

/// 10 x 10 m, an anchor in the middle, sights from the south.
Sight from_south(std::vector<BuiltWall> walls) {
  const std::vector<Vector3d> anchors{{5, 5, 2}};
  const Building building{
      {{0, 0}, {10, 0}, {10, 10}, {0, 10}}, 6, std::make_shared<std::vector<BuiltWall>>(std::move(walls))};
  return Design(anchors, {}, building).sights({5, -4, 2}).front();
}

// wall_excess_m is 0.2: 0.2 m of brick are 0.9748418 of an unknown wall.
TEST(Design, TakesAnAcceptedWallAtTheOutlineForTheFacade) {
  EXPECT_NEAR(from_south({}).slant, 1, 1e-12) << "of unknown make";
  EXPECT_NEAR(from_south({{{0, 0.1}, {10, 0.1}, 0, 6, 0.2, WallMaterial::brick}}).slant, 0.9748418, 1e-7);
  EXPECT_NEAR(from_south({{{0, 0.1}, {4, 0.1}, 0, 6, 0.2, WallMaterial::brick}}).slant, 1, 1e-12)
      << "beside a window that was traced as a gap";
}

TEST(Design, AddsAcceptedWallsInsideToTheFacade) {
  EXPECT_NEAR(from_south({{{0, 3}, {10, 3}, 0, 6, 0.2, WallMaterial::brick}}).slant, 1.9748418, 1e-7);
}

TEST(Design, ExpectsNoRangeThroughMetal) {
  EXPECT_EQ(from_south({{{0, 0.1}, {10, 0.1}, 0, 6, 0.01, WallMaterial::metal}}).row.norm(), 0);
}

/// A plan without a drawn outline beside a building of an accepted floor plan, 0..20 m east, 0..10 m north.
Plan plan_beside(const std::vector<Eigen::Vector2d>& waypoints_m) {
  Plan plan;
  plan.origin = Wgs84{51, 3.7, 20};
  const EnuFrame frame(*plan.origin);
  const auto at = [&](double east_m, double north_m) -> LonLat {
    const auto p = frame.wgs84_from_enu(Enu{{east_m, north_m, 0}});
    return {p.lon_deg, p.lat_deg};
  };
  auto structure = std::make_shared<SiteStructure>();
  structure->outlines = {{at(0, 0), at(20, 0), at(20, 10), at(0, 10)}};
  structure->walls = {{at(0, 5), at(20, 5), 0, 3, 0.2, WallMaterial::concrete}};
  plan.structure = structure;
  for (const auto& p : waypoints_m) {
    PlanWaypoint w;
    w.at = at(p.x(), p.y());
    w.height_m = 5;
    plan.waypoints.push_back(w);
  }
  return plan;
}

TEST(LocalPlan, HasAcceptedWallsAndBuildingsInItsMetres) {
  const auto local = local_plan(plan_beside({{-10, 5}})).value();
  ASSERT_TRUE(local.walls);
  ASSERT_EQ(local.walls->size(), 1u);
  EXPECT_NEAR(local.walls->front().to_m.x(), 20, 1e-3);
  EXPECT_NEAR(local.walls->front().to_m.y(), 5, 1e-3);
  const auto through = obstruction_between(*local.walls, {10, -10, 1}, {10, 8, 1});
  EXPECT_NEAR(through.excess_m, k_concrete_m, 1e-5);
}

TEST(LocalPlan, HasABuildingOnceWhateverItsFloors) {
  auto plan = plan_beside({{-10, 5}});
  auto structure = std::make_shared<SiteStructure>(*plan.structure);
  auto upper = structure->outlines[0];
  for (auto& corner : upper) corner.lon_deg += 0.05 / 70'200;  // 5 cm off, as two plans are
  structure->outlines.push_back(upper);
  plan.structure = structure;
  EXPECT_EQ(local_plan(plan).value().buildings.size(), 1u);
  plan.outline = upper;
  EXPECT_TRUE(local_plan(plan).value().buildings.empty()) << "the drawn outline is it";
}

TEST(PlanCheck, RefusesWaypointsInsideAnAcceptedBuildingAndWaysThroughIt) {
  const auto code = [](const char* word, const char* at) {
    return testing::Contains(
        testing::AllOf(testing::Field(&PlanIssue::code, word), testing::Field(&PlanIssue::pointer, at)));
  };
  EXPECT_THAT(check_plan(plan_beside({{-10, 5}, {10, 5}})).value().issues, code("no_fly", "/waypoints/1"));
  EXPECT_THAT(check_plan(plan_beside({{-10, 5}, {30, 5}})).value().issues,
              code("path_blocked", "/waypoints/1"));
  EXPECT_TRUE(check_plan(plan_beside({{-10, -10}, {30, -10}})).value().flyable());
  auto without = plan_beside({{-10, 5}, {10, 5}});
  without.structure.reset();
  EXPECT_TRUE(check_plan(without).value().flyable());
}

// The outline drawn is the western half of what was accepted.
TEST(GenerateWaypoints, KeepsOutOfAnAcceptedBuildingThatIsLargerThanTheDrawnOne) {
  auto plan = plan_beside({});
  const auto& accepted = plan.structure->outlines[0];
  const double middle_deg = (accepted[0].lon_deg + accepted[1].lon_deg) / 2;
  plan.outline = {
      accepted[0], {middle_deg, accepted[1].lat_deg}, {middle_deg, accepted[2].lat_deg}, accepted[3]};
  const auto made = generate_waypoints(plan).value().plan;
  const auto local = local_plan(made).value();
  ASSERT_GE(local.waypoints_m.size(), 8u);
  for (const auto& w : local.waypoints_m) {
    EXPECT_FALSE(contains(local.buildings[0], w.head<2>()));
    EXPECT_GE(distance_to_edge_m(local.buildings[0], w.head<2>()), plan.settings.keep_out_m - 0.21);
  }
  EXPECT_TRUE(check_plan(made).value().flyable());
}

TEST(PlanOrigin, IsInTheMiddleOfAPlanOverTheDateLine) {
  Plan plan;
  plan.outline = {{179.9999, -17}, {-179.9999, -17}, {-179.9999, -16.9998}, {179.9999, -16.9998}};
  const auto origin = plan_origin(plan).value();
  EXPECT_NEAR(std::abs(origin.lon_deg), 180, 1e-9);
  EXPECT_NEAR(origin.lat_deg, -16.9999, 1e-9);
  // 0.0001 degrees of longitude there: 10.65 m (a = 6378137 m, f = 1/298.257223563).
  const auto local = local_plan(plan).value();
  for (const auto& corner : local.outline) EXPECT_NEAR(std::abs(corner.x()), 10.65, 0.01);
}

}  // namespace
}  // namespace anchord::planning::walls_test
