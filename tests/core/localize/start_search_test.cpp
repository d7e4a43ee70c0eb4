// The search for a start: every descent ends somewhere, says so, and competes.
#include "core/localize/start_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/localize/flight_solver.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::start_search_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

/// Loops at nearly one height round an anchor, a third of the ranges late: what real starts descend through.
std::vector<Observation> late_ranges(std::uint64_t seed, const Eigen::Vector3d& anchor) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<Observation> rows;
  for (int i = 0; i < 200; ++i) {
    const double turn = 4 * std::numbers::pi * i / 200;
    Observation o;
    o.tag_m = {12 * std::cos(turn), 8 * std::sin(turn), 1 + 0.15 * noise(random)};
    o.distance_m = (o.tag_m - anchor).norm() + 0.1 * noise(random);
    if (uniform(random) < 0.33) o.distance_m += 2 * uniform(random);
    o.sigma_m = 0.3;
    rows.push_back(o);
  }
  return rows;
}

TEST(AnchorSolver, SettlesFromEveryStartOfTheSearch) {
  SolverOptions options;
  options.loss = Loss::cauchy;
  options.loss_sigmas = 1.0;
  options.estimate_bias = true;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Eigen::Vector3d anchor(3.0 * static_cast<double>(seed) - 15, 2, 2.5);
    const auto rows = late_ranges(seed, anchor);
    double best_cost = 1e300;
    Eigen::Vector3d best_m(0, 0, 0);
    for (const auto& start : start_candidates(rows)) {
      const auto fit = solve_anchor_gauss_newton(rows, start, options);
      ASSERT_TRUE(fit) << "seed " << seed << ", from " << start.transpose() << ": " << fit.error().message;
      if (fit.value().cost < best_cost) {
        best_cost = fit.value().cost;
        best_m = fit.value().position_m;
      }
    }
    EXPECT_LT((best_m - anchor).head<2>().norm(), 0.6) << "seed " << seed;
  }
}

TEST(AnchorSolver, KeepsPlaceAndCostOfAStartThatDoesNotSettle) {
  const Eigen::Vector3d anchor(4, -3, 2);
  const auto rows = late_ranges(3, anchor);
  SolverOptions options;
  options.loss = Loss::cauchy;
  options.loss_sigmas = 1.0;
  options.max_iterations = 3;
  const Eigen::Vector3d start = anchor + Eigen::Vector3d(4, 3, 0.5);
  EXPECT_EQ(solve_anchor_gauss_newton(rows, start, options).error().code, Errc::no_convergence);
  const auto end = descend_to_minimum(rows, start, options);
  ASSERT_TRUE(end);
  EXPECT_FALSE(end.value().settled);
  EXPECT_LT((end.value().position_m - anchor).norm(), (start - anchor).norm());
  options.max_iterations = 100;
  const auto further = descend_to_minimum(rows, start, options);
  EXPECT_TRUE(further.value().settled);
  EXPECT_LT(further.value().cost, end.value().cost);
}

TEST(StartSearch, ReportsHowManyStartsEndedWhere) {
  MadeFlight made;
  made.nlos_share = 0.3;
  made.height_swing_m = 0;  // one height: the mirror is a second place
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const StartSearch& search = s.value().anchors[i].search;
    EXPECT_GE(search.n_starts, 15);
    EXPECT_EQ(search.n_settled, search.n_starts);
    ASSERT_FALSE(search.places.empty());
    EXPECT_LT((search.places.front().position_m - made.anchors[i]).head<2>().norm(), 0.5);
    int counted = 0;
    for (const auto& place : search.places) {
      EXPECT_GE(place.cost, search.places.front().cost);
      counted += place.n_starts;
    }
    EXPECT_LE(counted, search.n_starts);
  }
}

}  // namespace
}  // namespace anchord::start_search_test
