#include "drivers/sim/path.hpp"

#include <gtest/gtest.h>

#include "core/base/angle.hpp"
#include "drivers/sim/scenario.hpp"

namespace anchord::sim::path_test {
namespace {

TEST(FlightPath, FliesHoldsTurnsAndLoops) {
  PathPoint a, b;
  b.enu_m = {10, 0, 0};
  b.hold_s = 4;
  b.turn = true;
  const FlightPath path({a, b}, 2, true);
  EXPECT_DOUBLE_EQ(path.duration_s(), 5 + 4 + 5);
  EXPECT_EQ(path.at(2.5).enu_m, Eigen::Vector3d(5, 0, 0));
  EXPECT_EQ(path.at(2.5).velocity_mps, Eigen::Vector3d(2, 0, 0));
  EXPECT_NEAR(path.at(2.5).heading_rad, 90 * k_degree, 1e-12);  // east
  EXPECT_NEAR(path.at(7).heading_rad, (90 + 180) * k_degree, 1e-12);
  EXPECT_EQ(path.at(7).velocity_mps, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(path.at(11.5).enu_m, Eigen::Vector3d(5, 0, 0));
  EXPECT_EQ(path.at(14 + 2.5).enu_m, path.at(2.5).enu_m);
}

TEST(FlightPath, EndsInAHoverWithoutALoop) {
  PathPoint a, b;
  b.enu_m = {0, 6, 3};
  const FlightPath path({a, b}, 1, false);
  EXPECT_EQ(path.at(1000).enu_m, b.enu_m);
  EXPECT_NEAR(path.at(1000).heading_rad, 0, 1e-12);  // north
}

TEST(Pose, TurnsForwardToTheEastAtHeading90) {
  Pose pose;
  pose.heading_rad = 90 * k_degree;
  EXPECT_TRUE((pose.enu_from_body() * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 0, 0), 1e-12));
  EXPECT_TRUE((pose.enu_from_body() * Eigen::Vector3d(0, 1, 0)).isApprox(Eigen::Vector3d(0, 1, 0), 1e-12));
}

TEST(LiveMover, FliesToItsGoalAtItsSpeedAndStops) {
  LiveMover mover({}, 2);
  mover.go_to({0, 10, 0}, std::nullopt);
  EXPECT_EQ(mover.at(1).enu_m, Eigen::Vector3d(0, 2, 0));
  EXPECT_EQ(mover.at(100).enu_m, Eigen::Vector3d(0, 10, 0));
  EXPECT_EQ(mover.at(101).velocity_mps, Eigen::Vector3d(0, 0, 0));
}

TEST(Slab, IsCrossedInsideItsOutlineOnly) {
  World world;
  // An L: the corner x, y > 5 is open.
  world.slabs = {{{{0, 0}, {10, 0}, {10, 5}, {5, 5}, {5, 10}, {0, 10}}, 3, 0.25, {"test", 4.0, 14.0}}};
  EXPECT_EQ(obstruction_between(world, {2, 2, 0}, {2, 2, 6}).panels, 1);
  EXPECT_NEAR(obstruction_between(world, {2, 2, 0}, {2, 2, 6}).excess_m, 0.25, 1e-12);
  EXPECT_EQ(obstruction_between(world, {7, 7, 0}, {7, 7, 6}).panels, 0);
  EXPECT_EQ(obstruction_between(world, {2, 2, 0}, {2, 2, 2.9}).panels, 0);
}

TEST(Scenario, OfTheDemonstrationCanRunAndNonsenseCannot) {
  Scenario scenario = demonstration_scenario();
  EXPECT_TRUE(check(scenario));
  scenario.tags.push_back(scenario.tags.front());
  EXPECT_FALSE(check(scenario));
  scenario = demonstration_scenario();
  scenario.faults = {{"nobody", FaultKind::unplug, 0, 1}};
  EXPECT_FALSE(check(scenario));
  scenario.faults = {{"tag", FaultKind::silence, 5, 6}};
  EXPECT_TRUE(check(scenario));
  EXPECT_TRUE(fault_at(scenario, "tag", FaultKind::silence, 5.5));
  EXPECT_FALSE(fault_at(scenario, "tag", FaultKind::silence, 6));
  EXPECT_FALSE(fault_at(scenario, "tag", FaultKind::unplug, 5.5));
}

}  // namespace
}  // namespace anchord::sim::path_test
