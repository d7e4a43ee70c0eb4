// Anchors that a later flight finds elsewhere: moved, exchanged, or neither.
#include "core/localize/contradiction.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "core/localize/flight_solver.hpp"
#include "flight_support.hpp"

namespace anchord::contradiction_test {
namespace {

constexpr double k_limit = 16.266;  // chi-square tables: 99.9 %, three degrees of freedom

KnownPlace at(double x_m, double y_m, double sigma_m = 0.05) {
  return {{x_m, y_m, 2}, Eigen::Matrix3d::Identity() * sigma_m * sigma_m};
}

TEST(Contradictions, AreCountedInTheMetricOfBothCovariances) {
  // Both 0.05 m: their difference has sigma sqrt(2) x 0.05 = 0.0707 m, the limit is about 4.05 of it: 0.286
  // m.
  for (const auto& [apart_m, contradicted] : {std::pair{0.283, false}, {0.288, true}}) {
    const std::vector<PlaceTwice> pairs{{NetworkId{1}, at(0, 0), at(apart_m, 0)}};
    const auto found = contradictions(pairs);
    ASSERT_EQ(found.size(), contradicted ? 1u : 0u) << apart_m;
    if (!contradicted) continue;
    EXPECT_NEAR(found[0].chi2, apart_m * apart_m / 0.005, 1e-9);
    EXPECT_NEAR(found[0].limit, k_limit, 0.02 * k_limit);  // chi2_quantile: within 2 %
    EXPECT_NEAR(found[0].p_value, 0.001, 2e-4);
    EXPECT_FALSE(found[0].exchange.has_value());
  }
}

TEST(Contradictions, LeaveAHeldHeightOutOfIt) {
  PlaceTwice pair{NetworkId{1}, at(0, 0), at(0, 0)};
  pair.later.at_m.z() += 5;
  pair.plane = true;
  EXPECT_TRUE(contradictions(std::span(&pair, 1)).empty());
  pair.later.at_m.x() += 1;
  const auto found = contradictions(std::span(&pair, 1));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].limit, 13.816, 1e-3);  // tables: 99.9 %, two degrees of freedom
  EXPECT_NEAR(found[0].p_value, std::exp(-100.0), 1e-50);
}

TEST(Contradictions, NeedFiveTimesTheDistanceFromAnAnswerThatFailedAGate) {
  PlaceTwice pair{NetworkId{1}, at(0, 0), at(1.3, 0)};
  pair.acceptable = false;
  EXPECT_TRUE(contradictions(std::span(&pair, 1)).empty());
  pair.later = at(1.5, 0);
  EXPECT_EQ(contradictions(std::span(&pair, 1)).size(), 1u);
}

TEST(Contradictions, NameThePairThatWasExchangedAndNotTheThirdThatMoved) {
  const std::vector<PlaceTwice> pairs{{NetworkId{1}, at(0, 0), at(8.05, 0)},
                                      {NetworkId{2}, at(8, 0), at(0, 0.04)},
                                      {NetworkId{3}, at(4, 6), at(4, 16)},
                                      {NetworkId{4}, at(2, 2), at(2.02, 2)}};
  const auto found = contradictions(pairs);
  ASSERT_EQ(found.size(), 3u);
  ASSERT_TRUE(found[0].exchange && found[1].exchange);
  EXPECT_EQ(found[0].exchange->with, NetworkId{2});
  EXPECT_EQ(found[1].exchange->with, NetworkId{1});
  EXPECT_NEAR(found[0].exchange->chi2, (8.05 * 8.05 + 8 * 8 + 0.04 * 0.04) / 0.005, 1e-6);
  EXPECT_NEAR(found[0].exchange->chi2_exchanged, (0.05 * 0.05 + 0.04 * 0.04) / 0.005, 1e-9);
  EXPECT_FALSE(found[2].exchange.has_value());
}

TEST(Contradictions, NameAnExchangeAlsoWhereTheyHangNearbyOnly) {
  const std::vector<PlaceTwice> pairs{{NetworkId{1}, at(0, 0), at(8.4, 0)},
                                      {NetworkId{2}, at(8, 0), at(0.4, 0)}};
  const auto found = contradictions(pairs);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_TRUE(found[0].exchange.has_value());
}

TEST(Contradictions, PassOverWhatHasNoUsableCovariance) {
  PlaceTwice pair{NetworkId{1}, at(0, 0), at(9, 0)};
  pair.published.covariance_m2.setConstant(NAN);
  EXPECT_TRUE(contradictions(std::span(&pair, 1)).empty());
}

KnownPlace place(const AnchorSolution& a) {
  return {a.estimate.best->position.m, a.estimate.best->covariance_m2};
}

/// Two flights of one scene: a clean kit, another path through the noise.
FlightSolution flown(std::uint64_t seed, const testing::MadeFlight& scene) {
  testing::MadeFlight m = scene;
  m.seed = seed;
  const auto solved = solve_flight(testing::make_flight(m));
  EXPECT_TRUE(solved.has_value());
  return solved.value();
}

TEST(Contradictions, NoneAmongAHundredFlightsPastAnchorsThatStayed) {
  testing::MadeFlight scene;
  scene.duration_s = 80;
  scene.nlos_share = 0.1;
  int alarms = 0, compared = 0;
  FlightSolution before = flown(1000, scene);
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    const FlightSolution now = flown(seed, scene);
    std::vector<PlaceTwice> pairs;
    for (std::size_t i = 0; i < now.anchors.size(); ++i) {
      const auto& e = now.anchors[i].estimate;
      if (e.verdict != Verdict::ok || before.anchors[i].estimate.verdict != Verdict::ok) continue;
      pairs.push_back({e.anchor, place(before.anchors[i]), place(now.anchors[i]), e.acceptable()});
    }
    compared += static_cast<int>(pairs.size());
    alarms += static_cast<int>(contradictions(pairs).size());
    before = now;
  }
  EXPECT_GE(compared, 300);
  EXPECT_EQ(alarms, 0);
}

TEST(Contradictions, OfAFlightInWhichOneMovedAndTwoWereExchanged) {
  const testing::MadeFlight scene;
  testing::MadeFlight later = scene;
  later.anchors[0] += Eigen::Vector3d(0, 30, 0);
  std::swap(later.anchors[1], later.anchors[2]);
  const FlightSolution before = flown(7, scene), now = flown(8, later);
  std::vector<PlaceTwice> pairs;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& e = now.anchors[i].estimate;
    ASSERT_TRUE(e.best.has_value()) << i << e.reason;
    pairs.push_back({e.anchor, place(before.anchors[i]), place(now.anchors[i]), e.acceptable()});
  }
  const auto found = contradictions(pairs);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_NEAR(found[0].delta_m.norm(), 30, 0.5);
  EXPECT_FALSE(found[0].exchange.has_value());
  ASSERT_TRUE(found[1].exchange.has_value());
  EXPECT_EQ(found[1].exchange->with, NetworkId{0x6002});
}

}  // namespace
}  // namespace anchord::contradiction_test
