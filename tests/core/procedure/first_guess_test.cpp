#include "core/localize/first_guess.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace anchord::first_guess_test {
namespace {

using Eigen::Vector3d;

// Section 8.5: drone at (3, 0), anchor at (-1.2, 0): due west at 4.2 m.
TEST(FirstGuess, GoesTheDistanceAlongTheBearing) {
  const auto p = first_guess({3, 0, 1}, 4.2, 270 * std::numbers::pi / 180, 1);
  EXPECT_TRUE(p.isApprox(Vector3d(-1.2, 0, 1), 1e-12));
  EXPECT_NEAR(first_guess({0, 0, 4}, 5, 0, 1).y(), 4,
              1e-12);  // 3-4-5: the height difference is not in the plane
  EXPECT_TRUE(first_guess({0, 0, 9}, 5, 0, 1).isApprox(Vector3d(0, 0, 1)));
}

TEST(FirstGuess, TakesTheIntersectionOnTheSideOfTheGuess) {
  const Vector3d truth{-1.2, 0.7, 1}, one{3, 0, 1}, two{2.52, -0.48, 1};
  const double d1 = (truth - one).norm(), d2 = (truth - two).norm();
  EXPECT_TRUE(second_guess(one, d1, two, d2, 1, {-1, 1, 1}).value().isApprox(truth, 1e-9));
  const auto mirror = second_guess(one, d1, two, d2, 1, {3, -4, 1}).value();
  EXPECT_GT((mirror - truth).norm(), 1);
  EXPECT_NEAR((mirror - one).norm(), d1, 1e-9);
  EXPECT_NEAR((mirror - two).norm(), d2, 1e-9);
}

TEST(FirstGuess, BridgesASmallMissAndNamesALargeOne) {
  const auto p = second_guess({0, 0, 0}, 4.9, {10, 0, 0}, 4.9, 0, {5, 1, 0}).value();
  EXPECT_NEAR(p.x(), 5, 1e-9);
  EXPECT_EQ(second_guess({0, 0, 0}, 2, {10, 0, 0}, 2, 0, {5, 1, 0}).error().code, Errc::no_convergence);
  EXPECT_EQ(second_guess({1, 1, 0}, 2, {1, 1, 5}, 2, 0, {5, 1, 0}).error().code, Errc::weak_geometry);
}

TEST(FirstGuess, TakesASecondRangeToMendTheBearing) {
  const Vector3d truth{8, 12, 3}, turn{0, 0, 6};
  const double bearing_rad = std::atan2(8.0, 12.0) + 20 * std::numbers::pi / 180;
  std::vector<Observation> rows;
  for (const Vector3d& tag : {Vector3d(0.2, 0, 6), Vector3d(4, -3, 6), Vector3d(-9, 7, 5)})
    rows.push_back({tag, (tag - truth).norm(), 0.05});
  const auto only = first_guess(turn, rows[0].distance_m, bearing_rad, 3);
  EXPECT_GT((only - truth).norm(), 4);
  EXPECT_LT((guess_from_turn(rows, turn, bearing_rad, 3) - truth).norm(), 0.3);
  // A second range that would put it elsewhere than the bearing can mean is not believed.
  rows[2].distance_m = 3.5;
  EXPECT_LT((guess_from_turn(rows, turn, bearing_rad, 3) - only).norm(), 0.3);
}

}  // namespace
}  // namespace anchord::first_guess_test
