#include "core/nlos/rules.hpp"

#include <gtest/gtest.h>

namespace anchord::nlos::rules_test {

// eq 5.1 at 5 m: -80.3977 - 4.2354 = -84.6331 dBm.
TEST(RssRule, ThresholdIsThatOfEquation51) {
  const RssLine line;
  EXPECT_NEAR(line.threshold_dbm(5), -84.6331, 1e-9);
  EXPECT_TRUE(line.calls_los(-84.6, 5));
  EXPECT_FALSE(line.calls_los(-84.7, 5));
}

// Eleven levels 0..10 dB above a line at each distance: 90 % exceed the one 1 dB above it.
TEST(RssRule, FitFindsTheLineThatNinetyPercentExceed) {
  std::vector<RssSample> samples;
  for (double d = 2; d <= 10; d += 0.5)
    for (int i = 0; i <= 10; ++i) samples.push_back({d, -81 - 0.8 * d + i});
  const auto line = fit_rss_line(samples);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line.value().at_zero_dbm, -80, 1e-9);
  EXPECT_NEAR(line.value().slope_dbm_per_m, -0.8, 1e-9);
}

TEST(RssRule, FitRefusesASingleDistance) {
  const std::vector<RssSample> samples(20, RssSample{3, -80});
  EXPECT_EQ(fit_rss_line(samples).error().code, Errc::too_few_observations);
}

TEST(ThresholdRule, KeepsTheAskedShareOfNlosOnItsSide) {
  std::vector<double> nlos;
  for (int i = 0; i <= 100; ++i) nlos.push_back(i);
  const auto rule = fit_threshold_for_nlos_share(nlos, false, 0.90);
  ASSERT_TRUE(rule);
  EXPECT_NEAR(rule.value().threshold, 10, 1e-9);
  EXPECT_TRUE(rule.value().calls_los(9));
  EXPECT_FALSE(rule.value().calls_los(10));
}

TEST(ThresholdRule, FitFindsTheGapAndTheSide) {
  const std::vector<double> los{5, 6, 7}, nlos{1, 2, 3};
  const auto up = fit_threshold(los, nlos).value();
  EXPECT_TRUE(up.los_above);
  EXPECT_EQ(up.threshold, 4);
  EXPECT_FALSE(fit_threshold(nlos, los).value().los_above);
  EXPECT_FALSE(fit_threshold(los, {}).has_value());
}

TEST(FirstPathScore, IsOneBelowSixDbAndZeroAboveTen) {
  EXPECT_EQ(first_path_los_score(4), 1);
  EXPECT_EQ(first_path_los_score(8), 0.5);
  EXPECT_EQ(first_path_los_score(12), 0);
}

// eq 5.8 by hand: (2 * 1 + 1 * 0 + 1 * .5) / 4.
TEST(WeightedVote, IsTheWeightedMeanOfTheVoices) {
  const Vote votes[] = {{1, 2}, {0, 1}, {0.5, 1}};
  EXPECT_EQ(*weighted_p_nlos(votes), 0.625);
  EXPECT_FALSE(weighted_p_nlos({}));
  EXPECT_EQ(vote_weight(0.5), 0);
}

TEST(RuleRates, CountEachClassOnItsOwn) {
  RuleRates rates;
  rates.count(true, true);
  rates.count(true, false);
  rates.count(false, false);
  EXPECT_EQ(rates.los_rate(), 0.5);
  EXPECT_EQ(rates.nlos_rate(), 1);
}

}  // namespace anchord::nlos::rules_test
