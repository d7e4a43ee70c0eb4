#include "core/planning/bounds.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace anchord::planning::bounds_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// An L of 10 x 10 m with its upper right quarter missing.
const Polygon k_ell{{0, 0}, {10, 0}, {10, 5}, {5, 5}, {5, 10}, {0, 10}};

TEST(Bounds, InsideIncludesTheEdgeAndSeesTheNotch) {
  EXPECT_TRUE(contains(k_ell, {2, 2}));
  EXPECT_TRUE(contains(k_ell, {5, 7}));
  EXPECT_TRUE(contains(k_ell, {0, 0}));
  EXPECT_FALSE(contains(k_ell, {7, 7}));
  EXPECT_FALSE(contains(k_ell, {-1, 0}));
  EXPECT_FALSE(contains({{0, 0}, {1, 1}}, {0.5, 0.5}));  // two corners enclose nothing
}

TEST(Bounds, SegmentsCrossWhenTheyTouchOverlapOrPassThrough) {
  EXPECT_TRUE(segments_cross({0, 0}, {2, 2}, {0, 2}, {2, 0}));
  EXPECT_TRUE(segments_cross({0, 0}, {2, 0}, {1, 0}, {1, 5}));
  EXPECT_TRUE(segments_cross({0, 0}, {2, 0}, {1, 0}, {3, 0}));
  EXPECT_FALSE(segments_cross({0, 0}, {2, 0}, {3, 0}, {4, 0}));
  EXPECT_FALSE(segments_cross({0, 0}, {2, 0}, {0, 1}, {2, 1}));
}

TEST(Bounds, DistancesByHand) {
  EXPECT_DOUBLE_EQ(distance_to_segment_m({0, 3}, {-1, 0}, {1, 0}), 3);
  EXPECT_DOUBLE_EQ(distance_to_segment_m({4, 4}, {-1, 0}, {1, 0}), 5);
  EXPECT_DOUBLE_EQ(distance_to_segment_m({4, 4}, {1, 0}, {1, 0}), 5);  // a wall of no length
  EXPECT_DOUBLE_EQ(distance_between_segments_m({0, 0}, {2, 2}, {0, 2}, {2, 0}), 0);
  EXPECT_DOUBLE_EQ(distance_between_segments_m({0, 0}, {2, 0}, {0, 1}, {2, 1}), 1);
}

TEST(Bounds, CoverWhatLiesInThemOrBesideThemBySoMuch) {
  const Polygon square{{1, 1}, {4, 1}, {4, 4}, {1, 4}};
  EXPECT_TRUE(covers(k_ell, square, 0));
  EXPECT_FALSE(covers(square, k_ell, 0.1));
  EXPECT_TRUE(covers(k_ell, {{-0.1, -0.1}, {4, 0}, {4, 4}}, 0.15));
  EXPECT_FALSE(covers(k_ell, {{-0.2, -0.2}, {4, 0}, {4, 4}}, 0.15));
  EXPECT_FALSE(covers(k_ell, {{1, 9.9}, {1, 1}, {9.9, 1}}, 0.1))
      << "all corners inside, an edge across the notch";
  EXPECT_FALSE(covers({{0, 0}, {1, 1}}, square, 5)) << "two corners enclose nothing";
}

TEST(Bounds, RefusesPointsByTheRuleTheyBreak) {
  Bounds bounds;
  bounds.fence = {{-50, -50}, {50, -50}, {50, 50}, {-50, 50}};
  bounds.no_fly = {k_ell};
  bounds.keep_out_m = 2;
  bounds.walls = {{{20, -10}, {20, 10}, 1.0, 0}};
  bounds.min_height_m = 1;
  bounds.max_height_m = 30;
  EXPECT_EQ(refuse_point(bounds, {0, 60, 5}), Refusal::outside_fence);
  EXPECT_EQ(refuse_point(bounds, {std::numeric_limits<double>::quiet_NaN(), 0, 5}), Refusal::outside_fence);
  EXPECT_EQ(refuse_point(bounds, {2, 2, 5}), Refusal::no_fly);
  EXPECT_EQ(refuse_point(bounds, {-1.9, 2, 5}), Refusal::no_fly);
  EXPECT_EQ(refuse_point(bounds, {-2, 2, 5}), std::nullopt);
  EXPECT_EQ(refuse_point(bounds, {19.5, 0, 5}), Refusal::near_wall);
  EXPECT_EQ(refuse_point(bounds, {30, 0, 0.5}), Refusal::too_low);
  EXPECT_EQ(refuse_point(bounds, {30, 0, 31}), Refusal::too_high);
}

TEST(Bounds, RefusesAWayThatCutsTheNotchOfAConcaveFence) {
  Bounds bounds;
  bounds.fence = k_ell;
  EXPECT_EQ(refuse_path(bounds, {9, 4, 5}, {4, 9, 5}), Refusal::path_blocked);
  EXPECT_EQ(refuse_path(bounds, {1, 1, 5}, {4, 9, 5}), std::nullopt);
  EXPECT_EQ(refuse_path(bounds, {5, 5, 5}, {5, 10, 5}), std::nullopt);  // along the fence itself
}

TEST(Bounds, RefusesAWayThroughABuildingThoughBothEndsAreFree) {
  Bounds bounds;
  bounds.no_fly = {k_ell};
  EXPECT_EQ(refuse_path(bounds, {-3, 2, 5}, {13, 2, 5}), Refusal::path_blocked);
  EXPECT_EQ(refuse_path(bounds, {-3, -2, 5}, {13, -2, 5}), std::nullopt);
  bounds.keep_out_m = 3;
  EXPECT_EQ(refuse_path(bounds, {-3, -2, 5}, {13, -2, 5}), Refusal::path_blocked);
}

TEST(Bounds, MayLeaveAKeepOutZoneButNotGoDeeper) {
  Bounds bounds;
  bounds.no_fly = {k_ell};
  bounds.keep_out_m = 3;
  EXPECT_EQ(refuse_path(bounds, {-1, 2, 5}, {-4, 2, 5}), std::nullopt);
  EXPECT_EQ(refuse_path(bounds, {-2, 2, 5}, {-1, 2, 5}), Refusal::path_blocked);
}

TEST(Bounds, WallsInARowMultiplyTheChanceOfASight) {
  Bounds bounds;
  bounds.walls = {{{1, -1}, {1, 1}, 0, 0.5}, {{2, -1}, {2, 1}, 0, 0.8}};
  EXPECT_DOUBLE_EQ(p_nlos_through(bounds, {0, 0, 1}, {3, 0, 1}), 0.9);
  EXPECT_DOUBLE_EQ(p_nlos_through(bounds, {0, 0, 1}, {1.5, 0, 1}), 0.5);
  EXPECT_DOUBLE_EQ(p_nlos_through(bounds, {0, 5, 1}, {3, 5, 1}), 0.0);
}

}  // namespace
}  // namespace anchord::planning::bounds_test
