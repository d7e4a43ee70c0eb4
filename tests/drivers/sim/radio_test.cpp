#include "drivers/sim/radio.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/planning/walls.hpp"

namespace anchord::sim::radio_test {
namespace {

World one_wall(const Material& material, double thickness_m) {
  World world;
  world.panels = {{{5, -10, -10}, {0, 20, 0}, {0, 0, 20}, thickness_m, material}};
  return world;
}

TEST(Friis, LosesSixDecibelPerDoublingAndMatchesTheHandComputedLevelAtOneMetre) {
  // 20 log10(c / (4 pi f)) = 20 log10(0.075068 / 12.566371) = -44.475 dB at 3.9936 GHz and 1 m.
  EXPECT_NEAR(friis_dbm(0, 3.9936e9, 1), -44.475, 0.001);
  EXPECT_NEAR(friis_dbm(0, 3.9936e9, 10) - friis_dbm(0, 3.9936e9, 20), 6.0206, 1e-4);
}

TEST(Wall, AddsTheOpticalPathOfASlabAtRightAngles) {
  // (sqrt(4) - 1) * 0.3 m
  const Obstruction wall = obstruction_between(one_wall({"test", 4.0, 7.0}, 0.3), {0, 0, 0}, {10, 0, 0});
  EXPECT_EQ(wall.panels, 1);
  EXPECT_NEAR(wall.excess_m, 0.3, 1e-12);
  EXPECT_NEAR(wall.loss_db, 7.0, 1e-12);
}

TEST(Wall, IsThickerForARayAtAnAngle) {
  const Obstruction wall = obstruction_between(one_wall({"test", 4.0, 7.0}, 0.3), {0, 0, 0}, {10, 10, 0});
  EXPECT_NEAR(wall.excess_m, 0.3 * std::sqrt(2.0), 1e-12);
}

TEST(Wall, IsNotSeenBesideBeforeOrBehindTheLine) {
  const World world = one_wall(k_brick, 0.3);
  EXPECT_EQ(obstruction_between(world, {0, 0, 0}, {4.9, 0, 0}).panels, 0);
  EXPECT_EQ(obstruction_between(world, {5.1, 0, 0}, {9, 0, 0}).panels, 0);
  EXPECT_EQ(obstruction_between(world, {0, 30, 0}, {10, 30, 0}).panels, 0);
  EXPECT_EQ(obstruction_between(world, {5, 0, 0}, {5, 3, 0}).panels, 0) << "a ray inside the panel's plane";
}

TEST(Wall, OfAFloorPlanDelaysARangeAsThePlannerPredicts) {
  const std::vector<BuiltWall> walls{{{5, -10}, {5, 10}, 0, 3, 0.2, WallMaterial::concrete},
                                     {{7, -2}, {9, 8}, 0, 2, 0.1, WallMaterial::plasterboard},
                                     {{2, 3}, {8, 3}, 3, 6, 0.02, WallMaterial::glass}};
  World world;
  for (const auto& wall : walls) world.panels.push_back(panel_of(wall));
  int crossed = 0;
  for (const Eigen::Vector3d& to :
       {Eigen::Vector3d(12, 1, 1), {12, 8, 5}, {8, 9, 7}, {12, -9, 1}, {3, 1, 1}}) {
    const Eigen::Vector3d from(0, 0, 1.5);
    const Obstruction simulated = obstruction_between(world, from, to);
    const auto predicted = planning::obstruction_between(walls, from, to);
    EXPECT_EQ(simulated.panels, static_cast<int>(predicted.n)) << to.transpose();
    EXPECT_NEAR(simulated.excess_m, predicted.excess_m, 1e-12) << to.transpose();
    EXPECT_NEAR(simulated.loss_db, predicted.loss_db, 1e-12) << to.transpose();
    crossed += simulated.panels;
  }
  EXPECT_GE(crossed, 4) << "the rays above do meet walls";
}

TEST(Exchange, ComesOutLongAndWeakThroughAWall) {
  Random random(3);
  RadioOptions options;
  options.zero_chance = 0;
  options.shared_bias_m = 0;
  double excess_m = 0, level_dbm = 0;
  int heard = 0;
  const World brick = one_wall(k_brick, 0.22);
  for (int i = 0; i < 2000; ++i) {
    const auto exchange = simulate_exchange(brick, options, {0, 0, 0}, {{1}, {10, 0, 0}}, 0, random);
    if (!exchange) continue;
    EXPECT_FALSE(exchange->line_of_sight);
    excess_m += exchange->distance_m - exchange->truth_m;
    level_dbm += exchange->rss_dbm;
    ++heard;
  }
  EXPECT_NEAR(heard / 2000.0, 0.98, 0.02);
  // slab (sqrt(3.9) - 1) * 0.22 = 0.2145 m, and 15 % of it as the mean of the reflections
  EXPECT_NEAR(excess_m / heard, 0.2145 * 1.15, 0.005);
  EXPECT_NEAR(level_dbm / heard, -14.3 - 64.475 - 7.0, 0.1);
}

TEST(Exchange, IsLostBelowTheSensitivity) {
  Random random(4);
  RadioOptions options;
  int heard = 0;
  for (int i = 0; i < 500; ++i) {
    if (simulate_exchange(World{}, options, {0, 0, 0}, {{1}, {2000, 0, 0}}, 0, random)) ++heard;
  }
  EXPECT_EQ(heard, 0);  // -14.3 - 110.5 = -124.8 dBm
}

}  // namespace
}  // namespace anchord::sim::radio_test
