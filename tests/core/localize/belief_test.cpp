// The one-sided likelihood of a range a model spoke about.
#include <gtest/gtest.h>

#include <cmath>

#include "core/localize/belief_likelihood.hpp"

namespace anchord {
namespace {

RangeBelief half() {
  RangeBelief b;
  b.p_los = 0.5;
  b.los_sigma_m = 0.05;
  b.nlos_bias_m = 0.1;
  b.nlos_sigma_m = 0.1;
  b.nlos_tail_m = 0.4;
  return b;
}

TEST(BeliefLikelihood, IsAGaussianWhereLineOfSightIsCertain) {
  RangeBelief b;
  b.los_sigma_m = 0.05;
  const auto v = belief_value(b, 0.03, 0.0);
  // N(0.03; 0, 0.05) = 6.66 per metre against stray 0.001.
  EXPECT_NEAR(v.score_per_m, 0.03 / 0.0025, 0.01);
  EXPECT_NEAR(v.curvature_per_m2, 400.0, 0.2);
  EXPECT_NEAR(v.p_los, 1.0, 1e-3);
}

TEST(BeliefLikelihood, PullsLateRangesLittleAndEarlyOnesFully) {
  const auto late = belief_value(half(), 0.8, 0.0), early = belief_value(half(), -0.08, 0.0);
  EXPECT_LT(late.p_los, 1e-6);
  EXPECT_NEAR(late.score_per_m, 1.0 / 0.4, 0.1) << "the tail of an exponential";
  EXPECT_LT(early.score_per_m, -20.0);
}

// Scores against the logarithm of a density integrated numerically: EMG as a sum over delays.
TEST(BeliefLikelihood, ScoresAreTheSlopeOfTheDensity) {
  const RangeBelief b = half();
  const auto log_density = [&](double e) {
    const auto gauss = [](double x, double s) {
      return std::exp(-0.5 * x * x / (s * s)) / (s * 2.50662827463);
    };
    double delayed = 0;
    const double step = 0.0005;
    for (double d = 0.5 * step; d < 8; d += step)
      delayed +=
          step / b.nlos_tail_m * std::exp(-d / b.nlos_tail_m) * gauss(e - b.nlos_bias_m - d, b.nlos_sigma_m);
    return std::log(b.p_los * gauss(e, b.los_sigma_m) + (1 - b.p_los) * delayed + 1e-3);
  };
  for (const double e : {-0.6, -0.1, 0.0, 0.04, 0.2, 0.5, 1.5, 4.0}) {
    const double h = 1e-4;
    const double slope = (log_density(e + h) - log_density(e - h)) / (2 * h);
    EXPECT_NEAR(belief_value(b, e, 0.0).score_per_m, -slope, 0.002 * std::abs(slope) + 0.01) << e;
  }
}

TEST(BeliefLikelihood, StaysFiniteFarOut) {
  for (const double e : {-1e4, -50.0, 50.0, 1e4}) {
    const auto v = belief_value(half(), e, 4e-4);
    EXPECT_TRUE(std::isfinite(v.score_per_m) && std::isfinite(v.curvature_per_m2)) << e;
  }
}

}  // namespace
}  // namespace anchord
