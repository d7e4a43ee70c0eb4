#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "core/base/angle.hpp"
#include "core/localize/turn.hpp"
#include "core/procedure/exit_rule.hpp"
#include "core/procedure/height_search.hpp"

namespace anchord::procedure::priors_test {
namespace {

double apart_deg(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, 2 * std::numbers::pi)) / k_degree;
}

/// Two raised-cosine lobes at 120 and 250 degrees (Fig 8.4a), 8 dB high: another shape than the one fitted.
double measured_dbm(double orientation_deg) {
  double out = -90;
  for (const double lobe : {120.0, 250.0}) {
    const double d = std::abs(std::remainder(orientation_deg - lobe, 360.0));
    if (d < 70) out += 4 * (1 + std::cos(d / 70 * std::numbers::pi));
  }
  return out;
}

std::vector<TurnSample> turn(double bearing_deg, double step_deg, double noise_db, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> unit(0, 1);
  std::vector<TurnSample> out;
  for (double h = 0; h < 360; h += step_deg) {
    out.push_back({h * k_degree, measured_dbm(h - bearing_deg) + noise_db * unit(random)});
  }
  return out;
}

// 8.3.5: "able to identify the angle of the signal with an accuracy of about 20 degrees"; step as in
// chapter 4.
TEST(Turn, FindsTheBearingWithinTwentyDegreesInTwoDecibelsOfNoise) {
  int good = 0;
  for (unsigned i = 0; i < 200; ++i) {
    const double truth = 1.8 * i;
    const auto bearing = bearing_from_turn(turn(truth, 22.5, 2.0, i)).value();
    good += apart_deg(bearing.bearing_rad, truth * k_degree) <= 20;
  }
  EXPECT_GE(good, 190);
}

TEST(Turn, IsExactWithoutNoiseAndSaysHowSureItIs) {
  const auto clear = bearing_from_turn(turn(75, 5, 0, 1)).value();
  EXPECT_LT(apart_deg(clear.bearing_rad, 75 * k_degree), 2);
  const auto noisy = bearing_from_turn(turn(75, 22.5, 8, 1)).value();
  EXPECT_GT(clear.confidence, noisy.confidence);
  EXPECT_LE(clear.sigma_rad, noisy.sigma_rad);
}

TEST(Turn, NamesTurnsThatSayNothing) {
  EXPECT_EQ(bearing_from_turn(turn(10, 90, 0, 1)).error().code, Errc::too_few_observations);
  auto half = turn(10, 5, 0, 1);
  half.resize(half.size() / 2);
  EXPECT_EQ(bearing_from_turn(half).error().code, Errc::weak_geometry);
  std::vector<TurnSample> flat(36);
  for (std::size_t i = 0; i < flat.size(); ++i) flat[i] = {static_cast<double>(i) * 10 * k_degree, -80};
  EXPECT_EQ(bearing_from_turn(flat).error().code, Errc::weak_geometry);
}

// Fig 8.5b: from -0.5 to 0.5 m around, the peak gives the height to 20 cm.
TEST(HeightSearch, FindsTheAnchorsHeightWithinTwentyCentimetres) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0, 0.3);
  int good = 0;
  for (int i = 0; i < 200; ++i) {
    std::vector<HeightSample> samples;
    for (double h = 1.5; h <= 2.5; h += 0.05)
      samples.push_back({h, -80 - 12 * (h - 2.1) * (h - 2.1) + noise(random)});
    const auto guess = height_from_search(samples).value();
    EXPECT_GE(guess.sigma_m, 0.2);
    good += std::abs(guess.height_m - 2.1) <= 0.2;
  }
  EXPECT_GE(good, 190);
}

TEST(HeightSearch, SaysWhenTheBestLiesAtTheEdge) {
  std::vector<HeightSample> samples;
  for (double h = 1; h <= 3; h += 0.25) samples.push_back({h, -90 + 2 * h});
  const auto guess = height_from_search(samples).value();
  EXPECT_TRUE(guess.at_edge);
  EXPECT_EQ(guess.height_m, 3);
  EXPECT_EQ(guess.sigma_m, 1);
  samples.resize(3);
  EXPECT_EQ(height_from_search(samples).error().code, Errc::too_few_observations);
}

/// Levels over height of two upright half-wave dipoles, free space, from a distance; and of a hump that
/// passes within some decimetres.
std::vector<HeightSample> climb(double distance_m, double hump_db, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 0.5);
  std::vector<HeightSample> out;
  for (double h = 3.5; h <= 6.5; h += 0.1) {
    const double up_m = h - 5.0, elevation = std::atan2(up_m, distance_m);
    const double field = std::cos(std::numbers::pi / 2 * std::sin(elevation)) / std::cos(elevation);
    const double rss_dbm = -80 + 40 * std::log10(field) - 20 * std::log10(std::hypot(up_m, distance_m));
    out.push_back({h, rss_dbm + hump_db * std::exp(-0.5 * up_m * up_m / 0.64) + noise(random)});
  }
  return out;
}

TEST(HeightSearch, TakesAPeakThatNoAntennaMakesFromThereForNoHeight) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    // What antennas make, near and far.
    for (const double distance_m : {2.0, 4.0, 8.0, 15.0}) {
      const auto peak = height_from_search(climb(distance_m, 0, seed), distance_m);
      EXPECT_FALSE(peak.value().too_narrow) << distance_m << ' ' << seed;
    }
    // 8 dB within a metre, seen from 10 m.
    EXPECT_TRUE(height_from_search(climb(10, 8, seed), 10).value().too_narrow) << seed;
    EXPECT_FALSE(height_from_search(climb(10, 8, seed)).value().too_narrow) << "no distance, no judgement";
  }
}

TEST(ExitRule, EndsByGoalLimitOrBatteryWithTheReason) {
  ExitRule rule;
  rule.gdop_root = 0.8;
  rule.max_s = 300;
  EXPECT_FALSE(exit_of(rule, {10, {}, 0.9, 0.8, 100}));
  EXPECT_FALSE(exit_of(rule, {2, {}, 0.1, 0.8, 100}));  // too early to believe
  EXPECT_TRUE(exit_of(rule, {10, {}, 0.79, 0.8, 100})->reached);
  EXPECT_FALSE(exit_of(rule, {10, {}, 0.9, 0.8, 300})->reached);
  EXPECT_THAT(exit_of(rule, {40, {}, 0.9, 0.8, 100})->reason, testing::HasSubstr("40 of 40"));
  EXPECT_THAT(exit_of(rule, {1, {}, 5.0, 0.29, 100})->reason, testing::HasSubstr("battery at 29"));
}

}  // namespace
}  // namespace anchord::procedure::priors_test
