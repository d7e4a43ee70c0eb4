#include "core/localize/linear.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/core/localize/support.hpp"

namespace anchord::linear_test {
namespace {

Observation at(double x, double y, double z, const Eigen::Vector3d& anchor) {
  Observation o;
  o.tag_m = {x, y, z};
  o.distance_m = (o.tag_m - anchor).norm();
  return o;
}

TEST(LinearPosition, FindsTheAnchorOfAHandMadeTriangle) {
  // Eq 7.2-7.5 by hand: points (0,0), (4,0), (0,3), ranges to (1,1) are sqrt 2, sqrt 10, sqrt 5.
  std::vector<Observation> rows(3);
  rows[0].tag_m = {0, 0, 0};
  rows[1].tag_m = {4, 0, 0};
  rows[2].tag_m = {0, 3, 0};
  rows[0].distance_m = std::sqrt(2.0);
  rows[1].distance_m = std::sqrt(10.0);
  rows[2].distance_m = std::sqrt(5.0);
  const auto anchor = linear_position(rows, Dims::two);
  ASSERT_TRUE(anchor);
  EXPECT_LT((anchor.value() - Eigen::Vector3d(1, 1, 0)).norm(), 1e-12);
}

TEST(LinearPosition, IsExactForExactRangesInThreeDimensions) {
  const Eigen::Vector3d anchor(7, -3, 2);
  const std::vector<Observation> rows{at(0, 0, 0, anchor), at(10, 0, 1, anchor), at(0, 10, 2, anchor),
                                      at(5, 5, 9, anchor)};
  EXPECT_LT((linear_position(rows).value() - anchor).norm(), 1e-10);
}

TEST(LinearPosition, KeepsItsDigitsFarFromTheOrigin) {
  const Eigen::Vector3d far(4e5, 5.6e6, 100);  // projected coordinates, as people hand them in
  const Eigen::Vector3d anchor = far + Eigen::Vector3d(7, -3, 2);
  std::vector<Observation> rows{at(0, 0, 0, anchor), at(10, 0, 1, anchor), at(0, 10, 2, anchor),
                                at(5, 5, 9, anchor)};
  for (auto& o : rows) {
    o.tag_m += far;
    o.distance_m = (o.tag_m - anchor).norm();
  }
  EXPECT_LT((linear_position(rows).value() - anchor).norm(), 1e-6);
}

TEST(LinearPosition, SaysTooFewBelowFourRanges) {
  const Eigen::Vector3d anchor(1, 2, 3);
  const std::vector<Observation> rows{at(0, 0, 0, anchor), at(1, 0, 0, anchor), at(0, 1, 0, anchor)};
  EXPECT_EQ(linear_position(rows).error().code, Errc::too_few_observations);
}

TEST(LinearPosition, SaysWeakGeometryForOnePlane) {
  const Eigen::Vector3d anchor(1, 2, 3);
  const std::vector<Observation> rows{at(0, 0, 0, anchor), at(1, 0, 0, anchor), at(0, 1, 0, anchor),
                                      at(4, 5, 0, anchor)};
  EXPECT_EQ(linear_position(rows).error().code, Errc::weak_geometry);
}

TEST(LinearPosition, RefusesNan) {
  std::vector<Observation> rows(5);
  rows[3].distance_m = std::nan("");
  EXPECT_EQ(linear_position(rows).error().code, Errc::invalid_argument);
}

TEST(StartCandidates, HoldBothSidesOfAFlatTrack) {
  const Eigen::Vector3d anchor(2, 1, 3);
  std::mt19937_64 random(1);
  const auto rows = testing::ranges_from_box(random, anchor, 50, {10, 10, 0}, 0.0);
  bool above = false;
  bool below = false;
  for (const auto& start : start_candidates(rows)) {
    above = above || (start - anchor).norm() < 1e-3;
    below = below || (start - Eigen::Vector3d(2, 1, -3)).norm() < 1e-3;
  }
  EXPECT_TRUE(above);
  EXPECT_TRUE(below);
}

}  // namespace
}  // namespace anchord::linear_test
