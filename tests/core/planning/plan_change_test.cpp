// What two revisions of a plan differ in, by plans whose differences were made by hand.
#include "core/planning/plan_change.hpp"

#include <gtest/gtest.h>

namespace anchord::planning::plan_change_test {
namespace {

/// On the equator, where a degree of either way is as long: metres east.
PlanWaypoint at(double east_m, double height_m = 4) {
  PlanWaypoint w;
  w.at = {east_m / 111'195, 0};
  w.height_m = height_m;
  return w;
}
Plan plan(std::initializer_list<PlanWaypoint> waypoints) {
  Plan p;
  p.waypoints = waypoints;
  return p;
}
GeoPolygon area(double lon) { return {{lon, 0}, {lon + 1, 0}, {lon, 1}}; }

TEST(PlanChange, OfTheSamePlanIsEmptyAndGoesOnWhereItWas) {
  const auto p = plan({at(0), at(50), at(100)});
  const auto change = plan_change(p, p, 2);
  EXPECT_TRUE(change.waypoints.empty());
  EXPECT_TRUE(change.areas.empty());
  EXPECT_EQ(change.next, 2u);
}

TEST(PlanChange, TellsAddedRemovedMovedAndAlteredWaypointsApart) {
  const auto before = plan({at(0), at(50), at(100), at(150)});
  auto altered = at(150);
  altered.turn = true;
  const auto change = plan_change(before, plan({at(0), at(25), at(53), altered}), 1);
  ASSERT_EQ(change.waypoints.size(), 4u);
  EXPECT_EQ(change.waypoints[0].change, Changed::added);
  EXPECT_EQ(change.waypoints[0].after, 1u);
  EXPECT_EQ(change.waypoints[1].change, Changed::moved);
  EXPECT_EQ(change.waypoints[1].before, 1u);
  EXPECT_EQ(change.waypoints[1].after, 2u);
  EXPECT_NEAR(change.waypoints[1].moved_m, 3, 1e-9);
  EXPECT_EQ(change.waypoints[2].change, Changed::removed);
  EXPECT_EQ(change.waypoints[2].before, 2u);
  EXPECT_EQ(change.waypoints[3].change, Changed::altered);
  EXPECT_EQ(change.waypoints[3].moved_m, 0);
  EXPECT_EQ(change.next, 1u) << "what is added behind the one that is flown is flown";
}

TEST(PlanChange, GoesOnBehindTheLastWaypointThatIsFlown) {
  const auto before = plan({at(0), at(50), at(100)});
  EXPECT_EQ(plan_change(before, plan({at(-50), at(0), at(25), at(50), at(100)}), 2).next, 4u)
      << "one before is too late";
  EXPECT_EQ(plan_change(before, plan({at(0), at(100)}), 2).next, 1u) << "the present one is removed";
  EXPECT_EQ(plan_change(before, plan({at(300), at(400)}), 2).next, 0u) << "nothing is left of what is flown";
  EXPECT_EQ(plan_change(before, plan({}), 2).next, 0u);
  EXPECT_EQ(plan_change(before, plan({at(0), at(50)}), 2).next, 2u) << "nothing is left to fly";
  EXPECT_EQ(plan_change(before, plan({at(0, 9), at(50), at(100)}), 1).next, 1u) << "higher is moved";
}

TEST(PlanChange, PairsNoFlyAreasByWhatTheyAre) {
  Plan before, after;
  before.no_fly = {area(1), area(2), area(3)};
  after.no_fly = {area(3), area(4), area(1), area(5)};
  before.fence = area(0);
  after.outline = area(0);
  const auto change = plan_change(before, after, 0);
  ASSERT_EQ(change.areas.size(), 4u);
  EXPECT_EQ(change.areas[0].area, AreaKind::outline);
  EXPECT_EQ(change.areas[0].change, Changed::added);
  EXPECT_EQ(change.areas[1].area, AreaKind::fence);
  EXPECT_EQ(change.areas[1].change, Changed::removed);
  EXPECT_EQ(change.areas[2].change, Changed::moved);
  EXPECT_EQ(change.areas[2].before, 1u);
  EXPECT_EQ(change.areas[2].after, 1u);
  EXPECT_EQ(change.areas[3].change, Changed::added);
  EXPECT_EQ(change.areas[3].after, 3u);
}

TEST(PlanChange, NamesTheAnchorsThatComeAndGo) {
  Plan before, after;
  before.expected_anchors = {{1}, {2}};
  after.expected_anchors = {{2}, {3}};
  const auto change = plan_change(before, after, 0);
  EXPECT_EQ(change.anchors_added, std::vector<NetworkId>{{3}});
  EXPECT_EQ(change.anchors_removed, std::vector<NetworkId>{{1}});
}

TEST(PlanChange, NamesTheAnchorsWhoseTargetDiffers) {
  Plan before, after;
  before.anchor_target_sigma_m = {{{1}, 0.02}, {{2}, 0.03}, {{4}, 0.1}};
  after.anchor_target_sigma_m = {{{2}, 0.04}, {{3}, 0.05}, {{4}, 0.1}};
  const auto targets = plan_change(before, after, 0).targets;
  ASSERT_EQ(targets.size(), 3u);
  EXPECT_EQ(targets[0].anchor, NetworkId{1});
  EXPECT_EQ(targets[0].before_m, 0.02);
  EXPECT_EQ(targets[0].after_m, std::nullopt);
  EXPECT_EQ(targets[1].before_m, 0.03);
  EXPECT_EQ(targets[1].after_m, 0.04);
  EXPECT_EQ(targets[2].anchor, NetworkId{3});
  EXPECT_EQ(targets[2].before_m, std::nullopt);
}

}  // namespace
}  // namespace anchord::planning::plan_change_test
