// How near the bound of physics, in the dissertation's error model; tests/bench prints the same over more
// flights.
#include "tests/core/localize/cramer_rao.hpp"

#include <gtest/gtest.h>

#include <cstdio>

namespace anchord::testing::cramer_rao_test {
namespace {

constexpr int k_flights = 60;  // 480 anchors: coverage to 1 %

void expect_near_the_bound(Ranges ranges, double most) {
  const CramerRao c = cramer_rao(ranges, k_flights, 1);
  std::printf("RMSE %.4f m, %.3f of the bound, 95 %% region holds %.1f %%\n", c.rmse_m, c.rmse_over_bound,
              100 * c.coverage);
  EXPECT_LE(c.rmse_over_bound, most);
  EXPECT_GE(c.coverage, 0.93);
  EXPECT_LE(c.coverage, 0.97);
}

TEST(CramerRao, IsReachedWithCorrectWeights) { expect_near_the_bound(Ranges::labelled, 1.05); }
TEST(CramerRao, IsNearWithAFifthBlockedAndUnlabelled) { expect_near_the_bound(Ranges::unlabelled, 1.3); }

TEST(CramerRao, IsNotFarWithoutAnyModelOfBlockedRanges) {
  const CramerRao c = cramer_rao(Ranges::unmodelled, 20, 1);
  std::printf("RMSE %.4f m, %.3f of the bound, 95 %% region holds %.1f %%\n", c.rmse_m, c.rmse_over_bound,
              100 * c.coverage);
  EXPECT_LE(c.rmse_over_bound, 1.3);
  EXPECT_GE(c.coverage, 0.93);
}

}  // namespace
}  // namespace anchord::testing::cramer_rao_test
