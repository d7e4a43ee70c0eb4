// What the kit hides, put into simulated flights and found again: lever arm 0.3 m, time offset 80 ms, antenna
// delay 0.15 m, each alone and together.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::recovery_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

constexpr int k_seeds = 4;
// 0.3 m long. Level flight tells nothing of an upward part: every anchor would be as much higher.
const Eigen::Vector3d k_arm_m(0.24, -0.18, 0);
constexpr double k_lag_s = -0.08;
constexpr double k_delay_m = 0.15;

MadeFlight turning(int seed) {
  MadeFlight made;
  made.turn_rate_radps = 0.35;
  made.seed = static_cast<std::uint64_t>(seed);
  return made;
}

FlightOptions everything_asked() {
  FlightOptions options;
  options.lever_across_prior_m = 0.3;
  options.lever_prior_m = 0.3;
  options.correlation_s = 0;  // errors made here are white, and the solver is told so
  options.floor_sigma_m = 0.005;
  return options;
}

double mean_error_m(const FlightSolution& s, const MadeFlight& made) {
  double sum_m = 0;
  for (std::size_t i = 0; i < made.anchors.size(); ++i)
    sum_m += (s.anchors[i].estimate.best.value().position.m - made.anchors[i]).norm();
  return sum_m / static_cast<double>(made.anchors.size());
}

void expect_found(const Valued& found, double truth, const char* what) {
  EXPECT_NEAR(found.value, truth, 3.0 * found.sigma) << what;
  EXPECT_LT(found.sigma, 0.1) << what;
}

void expect_recovered(bool arm, bool lag, bool delay) {
  double clean_m = 0, affected_m = 0, ignored_m = 0;
  for (int seed = 1; seed <= k_seeds; ++seed) {
    const MadeFlight clean = turning(seed);
    MadeFlight made = clean;
    if (arm) made.arm_error_m = k_arm_m;
    if (lag) made.lag_s = k_lag_s;
    if (delay) made.bias_m = k_delay_m;
    const auto options = everything_asked();
    const auto without = solve_flight(make_flight(clean), options);
    const auto with = solve_flight(make_flight(made), options);
    ASSERT_TRUE(without);
    ASSERT_TRUE(with);
    clean_m += mean_error_m(without.value(), clean) / k_seeds;
    affected_m += mean_error_m(with.value(), made) / k_seeds;
    FlightOptions held;
    held.lever_prior_m = held.lag_prior_s = held.delay_prior_m = held.curve_prior_m = 1e-4;
    held.fixed_bias_m = 0.0;
    ignored_m += mean_error_m(solve_flight(make_flight(made), held).value(), made) / k_seeds;
    const SharedSolution& s = with.value().shared;
    expect_found(s.lever_forward_m.value(), made.arm_error_m.x(), "forward");
    expect_found(s.lever_left_m.value(), made.arm_error_m.y(), "left");
    expect_found(s.lag_s, made.lag_s, "lag");
    expect_found(s.bias_m, made.bias_m, "delay");
  }
  std::printf("anchor error: %.4f m without, %.4f m with, %.4f m where it is ignored\n", clean_m, affected_m,
              ignored_m);
  EXPECT_LT(affected_m, 1.1 * clean_m);
  EXPECT_GT(ignored_m, 1.5 * clean_m);
}

TEST(Recovery, FindsALeverArmOf30Centimetres) { expect_recovered(true, false, false); }
TEST(Recovery, FindsATimeOffsetOf80Milliseconds) { expect_recovered(false, true, false); }
TEST(Recovery, FindsAnAntennaDelayOf15Centimetres) { expect_recovered(false, false, true); }
TEST(Recovery, FindsAllThreeTogether) { expect_recovered(true, true, true); }

TEST(Recovery, FindsTheDelayOfOneAnchorAgainstTheOthers) {
  for (int seed = 1; seed <= k_seeds; ++seed) {
    MadeFlight made = turning(seed);
    made.delays_m = {0, 0.15};
    FlightOptions options;
    options.delay_prior_m = 0.15;
    const auto s = solve_flight(make_flight(made), options);
    ASSERT_TRUE(s);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto& e = s.value().anchors[i].estimate;
      EXPECT_NEAR(e.bias_m.value(), i == 1 ? 0.15 : 0.0, 3 * e.bias_sigma_m.value());
    }
    EXPECT_GT(s.value().anchors[1].delay_m.value() - s.value().anchors[0].delay_m.value(), 0.1);
  }
}

TEST(AnchorToAnchor, RangesTightenAWeakFlightInTheSameSolve) {
  double alone_m = 0, with_m = 0, sigma_alone_m = 0, sigma_with_m = 0;
  for (int seed = 1; seed <= k_seeds; ++seed) {
    MadeFlight made;
    made.seed = static_cast<std::uint64_t>(seed);
    made.duration_s = 30;
    made.width_m = 3;
    made.height_swing_m = 2;
    made.noise_m = 0.3;
    const auto alone = solve_flight(make_flight(made));
    made.pairs = true;
    FlightOptions options;
    options.pair_sigma_m = 0.05;
    options.pair_bias_prior_m = 0.15;
    const auto with = solve_flight(make_flight(made), options);
    ASSERT_TRUE(alone);
    ASSERT_TRUE(with);
    alone_m += mean_error_m(alone.value(), made) / k_seeds;
    with_m += mean_error_m(with.value(), made) / k_seeds;
    for (std::size_t i = 0; i < 4; ++i) {
      sigma_alone_m += std::sqrt(alone.value().anchors[i].fit_covariance_m2.trace());
      sigma_with_m += std::sqrt(with.value().anchors[i].fit_covariance_m2.trace());
    }
  }
  std::printf("anchor error %.3f m alone, %.3f m with ranges between anchors\n", alone_m, with_m);
  EXPECT_LT(with_m, alone_m);
  EXPECT_LT(sigma_with_m, 0.9 * sigma_alone_m);
}

}  // namespace
}  // namespace anchord::recovery_test
