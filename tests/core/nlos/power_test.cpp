#include "core/nlos/power.hpp"

#include <gtest/gtest.h>

namespace anchord::nlos::power_test {

// C, N, F of a worked example in the register description: levels to four decimals by hand.
TEST(FirstPathPower, MatchesTheWorkedExampleAtBothPrfs) {
  EXPECT_NEAR(*first_path_dbm(9120, 11840, 8603, 1016, Prf::mhz64), -97.1449, 1e-4);
  EXPECT_NEAR(*first_path_dbm(9120, 11840, 8603, 1016, Prf::mhz16), -89.1749, 1e-4);
  EXPECT_NEAR(*received_dbm(9143, 1016, Prf::mhz64), -91.0919, 1e-4);
  EXPECT_NEAR(*received_dbm(9143, 1016, Prf::mhz16), -83.1219, 1e-4);
  EXPECT_NEAR(*power_difference_db(9143, 9120, 11840, 8603), 6.0530, 1e-4);
}

TEST(FirstPathPower, HasNoValueForZeroCountsOrAmplitudes) {
  EXPECT_FALSE(first_path_dbm(0, 0, 0, 1016).has_value());
  EXPECT_FALSE(first_path_dbm(1, 1, 1, 0).has_value());
  EXPECT_FALSE(received_dbm(0, 1016).has_value());
  EXPECT_FALSE(received_dbm(9143, 0).has_value());
  EXPECT_FALSE(power_difference_db(0, 1, 1, 1).has_value());
}

// A public driver multiplies in 32 bits and wraps from C = 32768 on.
TEST(FirstPathPower, DoesNotWrapForLargeCirPower) {
  EXPECT_NEAR(*received_dbm(65535, 1024), *received_dbm(32767.5, 1024) + 3.0103, 1e-4);
}

TEST(PreambleCount, TakesTheSfdOffOnlyWhenTheCounterRanOverIt) {
  EXPECT_EQ(corrected_preamble_count(1080, 1080, Sfd::standard_64), 1016);
  EXPECT_EQ(corrected_preamble_count(1016, 1080, Sfd::standard_64), 1016);
  EXPECT_EQ(corrected_preamble_count(128, 128, Sfd::standard_8), 123);
}

TEST(StraightenedLevel, LeavesWeakLevelsAndRaisesStrongOnes) {
  EXPECT_EQ(straightened_dbm(-95, Prf::mhz64), -95);
  EXPECT_NEAR(straightened_dbm(-80, Prf::mhz64), -80 + 8 * 1.1667, 1e-12);
}

}  // namespace anchord::nlos::power_test
