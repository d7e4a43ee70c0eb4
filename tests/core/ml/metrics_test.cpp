#include "core/ml/metrics.hpp"

#include <gtest/gtest.h>

namespace anchord::ml::metrics_test {

// Ten links by hand: 5 LOS of which 4 right, 5 NLOS of which 3 right.
TEST(Confusion, RatesByHand) {
  const std::vector<double> p{.9, .8, .7, .6, .2, .1, .2, .3, .6, .9};
  const std::vector<std::uint8_t> los{1, 1, 1, 1, 1, 0, 0, 0, 0, 0};
  const auto c = confusion_at(p, los, 0.5);
  EXPECT_EQ(c.tp, 4);
  EXPECT_EQ(c.fn, 1);
  EXPECT_EQ(c.fp, 2);
  EXPECT_EQ(c.tn, 3);
  EXPECT_DOUBLE_EQ(c.accuracy(), 0.7);
  EXPECT_DOUBLE_EQ(c.fpr(), 0.4);
  EXPECT_DOUBLE_EQ(c.fnr(), 0.2);
  EXPECT_DOUBLE_EQ(c.balanced_accuracy(), 0.7);
  EXPECT_NEAR(brier(p, los), (.01 + .04 + .09 + .16 + .64 + .01 + .04 + .09 + .36 + .81) / 10, 1e-12);
}

TEST(Confusion, OfOneClassCountsOnlyThatClass) {
  const std::vector<double> p{.9, .1};
  const std::vector<std::uint8_t> los{1, 1};
  const auto c = confusion_at(p, los, 0.5);
  EXPECT_DOUBLE_EQ(c.balanced_accuracy(), 0.5);
  EXPECT_DOUBLE_EQ(c.fpr(), 0);
}

// Table 6.2's counts of the dissertation's logistic regression would do as well; here the textbook case with
// ties.
TEST(Roc, AreaIsTheChanceThatALosLinkScoresHigher) {
  const std::vector<double> p{.9, .5, .5, .1};
  const std::vector<std::uint8_t> los{1, 1, 0, 0};
  const auto curve = roc(p, los);
  EXPECT_DOUBLE_EQ(area_under(curve), 0.875);  // pairs: 1 + 1 + 1 + .5 of 4
  EXPECT_DOUBLE_EQ(curve.back().fpr, 1);
  EXPECT_DOUBLE_EQ(curve.back().tpr, 1);
}

// The dissertation's own figures: LOS MAE 37.2 mm is 64 % better than 103.3 mm.
TEST(ErrorStats, AndImprovementByHand) {
  const std::vector<double> e{0.1, -0.3, 0.2};
  EXPECT_NEAR(error_stats(e).mae_m, 0.2, 1e-12);
  EXPECT_NEAR(error_stats(e).mse_m2, 0.14 / 3, 1e-12);
  EXPECT_NEAR(improvement(0.1033, 0.0372), 0.64, 1e-3);
  EXPECT_LT(improvement(0.1, 0.2), 0);
  EXPECT_EQ(improvement(0, 0), 0);
}

TEST(Cdf, RunsOverMagnitudesFromLeastToMost) {
  const std::vector<double> v{-3, 1, 2};
  const auto curve = cdf_of_magnitude(v, 3);
  ASSERT_EQ(curve.size(), 3U);
  EXPECT_EQ(curve[0].value_m, 1);
  EXPECT_EQ(curve[1].value_m, 2);
  EXPECT_EQ(curve[2].value_m, 3);
}

}  // namespace anchord::ml::metrics_test
