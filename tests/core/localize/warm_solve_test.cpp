// Solves that begin where others ended, against Ceres, against each start by itself and against the
// definition.
#include "core/localize/warm_solve.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "core/localize/flight_solver.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/live_anchor.hpp"
#include "tests/core/localize/support.hpp"

namespace anchord::warm_solve_test {
namespace {

SolverOptions robust() {
  SolverOptions options;
  options.loss = Loss::cauchy;
  options.loss_sigmas = 2.0;
  options.estimate_bias = true;
  options.bias_prior_sigma_m = 0.3;
  options.step_tolerance_m = 1e-7;
  return options;
}

/// A fifth of the ranges is late; positions are better across than up.
std::vector<Observation> late_rows(std::mt19937_64& random, const Eigen::Vector3d& anchor, std::size_t n,
                                   const Eigen::Vector3d& half_box_m) {
  auto rows = testing::ranges_from_box(random, anchor, n, half_box_m, 0.05);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].tag_covariance_m2 = Eigen::Vector3d(100e-6, 100e-6, 400e-6).asDiagonal();
    if (i % 5 == 0) rows[i].distance_m += 0.8;
  }
  return rows;
}

TEST(WarmSolve, EndsWhereCeresDoesFromAnotherPlaceAndBias) {
  std::mt19937_64 random(41);
  std::uniform_real_distribution<double> side(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d anchor(15 * side(random), 15 * side(random), 8 * side(random));
    const auto rows = late_rows(random, anchor, 40 + static_cast<std::size_t>(i), {20, 20, 10});
    const auto ceres = solve_anchor(rows, anchor, robust());
    ASSERT_TRUE(ceres) << i;
    RangeBlock block(rows);
    const Eigen::Vector3d off(0.2 * side(random), 0.2 * side(random), 0.2 * side(random));
    const auto warm = solve_block(block, {anchor + off, 0.1 * side(random)}, robust(), 1e-5);
    ASSERT_TRUE(warm) << i << ' ' << warm.error().message;
    EXPECT_LT((warm.value().position_m - ceres.value().position_m).norm(), 1e-6) << i;
    EXPECT_NEAR(warm.value().bias_m, ceres.value().bias_m, 1e-6) << i;
    EXPECT_NEAR(warm.value().cost, ceres.value().cost, 1e-6 * ceres.value().cost) << i;
    EXPECT_LT((warm.value().covariance_m2 - ceres.value().covariance_m2).norm(), 1e-6) << i;
  }
}

// A flat track has two ends: the search ends at the better one, as solving from every start to the end does.
TEST(WarmSolve, FindsTheBestOfManyStarts) {
  std::mt19937_64 random(43);
  std::uniform_real_distribution<double> side(-1, 1);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d anchor(10 * side(random), 10 * side(random), 3 + 3 * side(random));
    const auto rows = late_rows(random, anchor, 80, {15, 15, 0.5});
    const auto starts = start_candidates(rows);
    double lowest = std::numeric_limits<double>::infinity();
    for (const auto& start : starts) {
      if (const auto fit = solve_anchor_gauss_newton(rows, start, robust()))
        lowest = std::min(lowest, fit.value().cost);
    }
    RangeBlock block(rows);
    const auto best = best_of_starts(block, starts, robust(), 1e-5, 1e-3);
    ASSERT_TRUE(best) << i << ' ' << best.error().message;
    EXPECT_NEAR(best.value().cost, lowest, 1e-9 * lowest) << i;
  }
}

TEST(WarmSolve, NamesWhatIsWrongWhereNoStartSettles) {
  std::mt19937_64 random(47);
  const auto rows = testing::ranges_from_box(random, {3, 4, 5}, 3, {10, 10, 10}, 0.1);
  RangeBlock block(rows);
  const std::vector<Eigen::Vector3d> starts{{0, 0, 0}};
  EXPECT_EQ(best_of_starts(block, starts, robust(), 1e-5, 1e-3).error().code, Errc::too_few_observations);
  EXPECT_EQ(best_of_starts(block, {}, robust(), 1e-5, 1e-3).error().code, Errc::no_convergence);
}

// What a joint solution said, refined by the ranges since: three steps of reweighted least squares, range by
// range, each worth the share of an independent look.
TEST(LiveAnchorRefinement, IsThreeStepsOfReweightedLeastSquares) {
  std::mt19937_64 random(53);
  const Eigen::Vector3d anchor(3, 4, 2);
  const auto rows = late_rows(random, anchor, 500, {20, 20, 10});
  LiveAnchor live(NetworkId{0x6a21});
  const UtcTime begin = UtcTime::from_seconds(1000);
  for (std::size_t i = 0; i < rows.size(); ++i)
    live.add(rows[i], UtcTime{begin.ns + static_cast<std::int64_t>(i) * 100'000'000}, {}, true);

  AnchorSolution solution;
  solution.estimate.best.emplace();
  solution.estimate.best->position.m = anchor + Eigen::Vector3d(0.05, -0.03, 0.08);
  solution.fit_covariance_m2 = Eigen::Vector3d(0.01, 0.02, 0.09).asDiagonal();
  solution.estimate.best->covariance_m2 = 2 * solution.fit_covariance_m2;
  solution.residual_scale_m = 0.06;
  solution.delay_m = 0.02;
  SharedSolution shared;
  shared.bias_m.value = 0.05;
  shared.curve_m.value = 0.03;
  ASSERT_TRUE(live.adopt(solution, shared, UtcTime{0}));

  const double per_look = 2.0 * k_error_correlation_s * 500 / 49.9;
  ASSERT_GT(per_look, 1) << "each range is less than a look";
  const Eigen::Matrix3d prior = solution.fit_covariance_m2.inverse();
  const Eigen::Vector3d before = solution.estimate.best->position.m;
  Eigen::Vector3d at = before;
  Eigen::Matrix3d information;
  for (int step = 0; step < 3; ++step) {
    information = prior;
    Eigen::Vector3d gradient = prior * (before - at);
    for (const auto& row : rows) {
      const Eigen::Vector3d u = (at - row.tag_m).normalized();
      const double curve = std::log(std::max(row.distance_m, 5.0) / 5.0);
      const double residual = row.distance_m - 0.07 - 0.03 * curve - (at - row.tag_m).norm();
      const double variance = 0.06 * 0.06 + u.dot(row.tag_covariance_m2 * u);
      const double weight = 1 / (1 + residual * residual / (4 * variance)) / variance / per_look;
      information += weight * u * u.transpose();
      gradient += weight * residual * u;
    }
    at += information.inverse() * gradient;
  }
  const Estimate estimate = live.estimate({});
  ASSERT_TRUE(estimate.best);
  EXPECT_GT((at - before).norm(), 0.01) << "the ranges say something";
  EXPECT_LT((estimate.best->position.m - at).norm(), 1e-11);
  const Eigen::Matrix3d covariance = information.inverse() + solution.fit_covariance_m2;
  EXPECT_LT((estimate.best->covariance_m2 - covariance).norm(), 1e-11);
}

}  // namespace
}  // namespace anchord::warm_solve_test
