#include "core/nlos/features.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace anchord::nlos::features_test {

// First row of the graz-rooms set; numbers with a pocket calculator.
TEST(Features, OfAMeasuredRowMatchHandNumbers) {
  DiagnosticSample s;
  s.range_m = 8.045;
  s.rx_dbm = -80.136;
  s.fp_amp1 = 1404, s.fp_amp2 = 1657, s.fp_amp3 = 1179;
  s.preamble_count = 101;
  s.std_noise = 36;
  const auto f = compute_features(s);
  EXPECT_NEAR(*f.get(Feature::fp_dbm), -93.968, 1e-3);  // the set's own column
  EXPECT_NEAR(*f.get(Feature::rx_minus_fp_db), 13.832, 1e-3);
  EXPECT_NEAR(*f.get(Feature::noise_excess_db), 3.683, 1e-3);  // 20 log10(36 / 10.0499) - 7.4
  EXPECT_NEAR(*f.get(Feature::fp_snr_db), 33.261, 1e-3);       // 20 log10(1657 / 36)
  EXPECT_NEAR(*f.get(Feature::rx_free_space_db), -62.025, 1e-3);
  EXPECT_NEAR(*f.get(Feature::total_snr_db), 50.564, 1e-3);  // -80.136 + 121.74 + 40.086 - 31.126
  EXPECT_FALSE(f.get(Feature::kurtosis));
  EXPECT_FALSE(f.get(Feature::log_range_spread));
}

TEST(Features, PreferRegistersOverLevelsOfAnotherConstant) {
  DiagnosticSample s;
  s.cir_power = 9143, s.preamble_count = 1016;
  s.rx_dbm = -200;
  EXPECT_NEAR(*compute_features(s).get(Feature::rx_dbm), -91.0919, 1e-4);
}

TEST(Features, LeaveOutWhatIsImpossible) {
  DiagnosticSample s;
  s.range_m = 0;
  s.rx_dbm = -std::numeric_limits<double>::infinity();
  s.std_noise = 0, s.preamble_count = 0;
  EXPECT_TRUE(compute_features(s).present.none());
}

// Without a count of symbols nothing is known against them, and the registers still give their difference.
TEST(Features, WithoutAPreambleCountAreThoseOfTheRegistersAlone) {
  DiagnosticSample s;
  s.cir_power = 9143;
  s.fp_amp1 = 9120, s.fp_amp2 = 11840, s.fp_amp3 = 8603;
  s.std_noise = 40;
  const auto f = compute_features(s);
  EXPECT_NEAR(*f.get(Feature::rx_minus_fp_db), 6.0530, 1e-4);
  EXPECT_NEAR(*f.get(Feature::total_snr_db), 58.7448, 1e-4);  // 10 log10(9143 2^17) - 20 log10 40
  EXPECT_NEAR(*f.get(Feature::fp_snr_db), 49.4258, 1e-4);     // 20 log10(11840 / 40)
  for (const auto feature :
       {Feature::rx_dbm, Feature::fp_dbm, Feature::preamble_db, Feature::noise_excess_db})
    EXPECT_FALSE(f.get(feature)) << feature_name(feature);
}

TEST(Features, HaveOneNameEachThatFindsThemAgain) {
  for (std::size_t i = 0; i < k_feature_count; ++i) {
    const auto f = static_cast<Feature>(i);
    EXPECT_EQ(feature_of(feature_name(f)), f);
  }
  EXPECT_FALSE(feature_of("no_such_feature"));
}

TEST(Features, AtRestAreMediansAndTheirSpreads) {
  std::vector<FeatureVector> repeats(5);
  const double ranges[] = {4.0, 4.1, 3.9, 9.0, 4.0};
  for (std::size_t i = 0; i < 5; ++i) repeats[i].set(Feature::range_m, ranges[i]);
  const auto f = aggregate_at_rest(repeats);
  EXPECT_EQ(*f.get(Feature::range_m), 4.0);
  // mean 5, squares 1 + .81 + 1.21 + 16 + 1 = 20.02, / 4
  EXPECT_NEAR(*f.get(Feature::log_range_spread), std::log(0.005 + std::sqrt(20.02 / 4)), 1e-9);
  EXPECT_FALSE(f.get(Feature::rx_dbm));
}

// Every feature by the least that gives it: what a flight's range with levels and CIR has is what models of
// flights may ask for.
TEST(Features, OfRangesOfAFlightAreThoseOfLevelsAndImpulseResponse) {
  std::size_t live = 0;
  for (std::size_t f = 0; f < k_feature_count; ++f) live += live_ranges_have(static_cast<Feature>(f)) ? 1 : 0;
  EXPECT_EQ(live, 15U);
  for (const char* name : {"height_difference_m", "heading_deg", "log_range_spread", "fp_snr_db",
                           "max_noise_db", "fp_index", "rms_delay_spread_whole_ns"})
    EXPECT_FALSE(live_ranges_have(*feature_of(name))) << name;
  EXPECT_EQ(needs_of(Feature::kurtosis), Needs::impulse);
}

TEST(RangeSpread, SlidesAndDropsZeroRanges) {
  RangeSpread window{3};
  window.add(1);
  window.add(0);
  window.add(2);
  EXPECT_FALSE(window.sd_m());
  window.add(3);
  EXPECT_NEAR(*window.sd_m(), 1, 1e-12);
  window.add(4);  // 2, 3, 4
  EXPECT_NEAR(*window.sd_m(), 1, 1e-12);
}

}  // namespace anchord::nlos::features_test
