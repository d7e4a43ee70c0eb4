#include "core/nlos/rule_table.hpp"

#include <gtest/gtest.h>

namespace anchord::nlos::rule_table_test {
namespace {

// Rows of table 5.1: right decisions of the printed RSS line.
struct Table51 {
  bool los;
  std::size_t right, wrong;
  double percent;
};
constexpr Table51 k_table51[]{{true, 17557, 1860, 90.42},
                              {false, 23067, 1451, 94.08},
                              {true, 33356, 9584, 77.68},
                              {false, 30109, 1459, 95.38}};

RuleSample at(bool los, double distance_m, double rss_dbm) {
  RuleSample s;
  s.los = los;
  s.distance_m = distance_m;
  s.rss_dbm = rss_dbm;
  return s;
}

}  // namespace

TEST(RuleTable, CountsRightDecisionsAsTable51Does) {
  for (const auto& row : k_table51) {
    std::vector<RuleSample> samples;
    const double line = RssLine{}.threshold_dbm(4.5);
    for (std::size_t i = 0; i < row.right + row.wrong; ++i)
      samples.push_back(at(row.los, 4.5, line + ((i < row.right) == row.los ? 1 : -1)));
    const auto judged = evaluate_rules(printed_rules(), samples);
    const auto& rates = judged[0].rates;
    EXPECT_NEAR(100 * (row.los ? rates.los_rate() : rates.nlos_rate()), row.percent, 0.005);
  }
}

TEST(RuleTable, PrintedThresholdsAreThoseOfChapterFive) {
  const auto rules = printed_rules();
  RuleSample s;
  s.range_sd_m = 0.049, s.rx_minus_fp_db = 6.1, s.rms_delay_spread_ns = 68.7, s.distance_m = 6.0;
  EXPECT_EQ(rules.calls_los(Rule::range_sd, s), true);
  EXPECT_EQ(rules.calls_los(Rule::first_path, s), false);
  EXPECT_EQ(rules.calls_los(Rule::rms_delay, s), true);      // 68.7 taps of 1.0016 ns are 68.81 ns
  EXPECT_FALSE(rules.calls_los(Rule::rms_delay_far, s));     // nearer than 6.5 m
  EXPECT_FALSE(rules.calls_los(Rule::kurtosis, s));          // no figure is printed for it
  EXPECT_EQ(rules.calls_los(Rule::rms_delay_95, s), false);  // 68.7 squared is 4720, above 4430
}

// Two voices of three say LOS, all weigh the same: p_NLOS = 1/3 (eq 5.8).
TEST(RuleTable, VoteIsTheWeightedMeanOfTheRulesThatCanSpeak) {
  const auto rules = printed_rules();
  RuleSample s;
  s.range_sd_m = 0.01, s.rx_minus_fp_db = 3, s.rms_delay_spread_ns = 90;
  EXPECT_NEAR(*rules.p_nlos(s), 1.0 / 3, 1e-12);
  EXPECT_EQ(rules.calls_los(Rule::weighted, s), true);
  EXPECT_FALSE(rules.p_nlos({}));
}

// LOS at 10 levels per distance, NLOS 20 dB below: a line fitted to the other places still parts them.
TEST(RuleTable, FittedRulesAreJudgedOnPlacesTheyHaveNotSeen) {
  std::vector<RuleSample> samples;
  std::vector<std::size_t> fold;
  for (std::size_t place = 0; place < 3; ++place)
    for (double d = 2; d <= 6; d += 1)
      for (int i = 0; i < 10; ++i) {
        samples.push_back(at(true, d, -60 - d + i));
        samples.push_back(at(false, d, -85 - d + i));
        samples[samples.size() - 2].kurtosis = 20 + i, samples.back().kurtosis = 5 + i;
        fold.insert(fold.end(), 2, place);
      }
  const auto row = evaluate_fitted_rules(samples, fold);
  EXPECT_EQ(row[0].rates.los, 150U);
  EXPECT_NEAR(row[0].rates.los_rate(), 0.9, 0.1 + 1e-9);  // 90 % of LOS by construction of the line
  EXPECT_EQ(row[0].rates.nlos_rate(), 1);
  EXPECT_EQ(row[1].rates.los_rate(), 1);  // kurtosis: LOS 20..29, NLOS 5..14
  EXPECT_EQ(row[1].rates.nlos_rate(), 1);
  EXPECT_FALSE(row[static_cast<std::size_t>(Rule::range_sd)].judged());
}

}  // namespace anchord::nlos::rule_table_test
