#include "drivers/sim/impulse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/angle.hpp"
#include "core/nlos/cir.hpp"

namespace anchord::sim::impulse_test {
namespace {

Exchange exchange_at(double rss_dbm, double wall_loss_db) {
  Exchange exchange;
  exchange.rss_dbm = rss_dbm;
  exchange.wall_loss_db = wall_loss_db;
  return exchange;
}

/// Median of P_RX - P_FP over seeded records, from our own CIR features (checked on public records
/// elsewhere).
double median_difference_db(double rss_dbm, double wall_loss_db) {
  Random random(8);
  std::vector<double> all;
  for (int i = 0; i < 60; ++i) {
    const auto taps = simulate_impulse(exchange_at(rss_dbm, wall_loss_db), {}, random);
    const auto shape = nlos::cir_shape(std::span(taps), std::nullopt);
    if (shape) all.push_back(10 * std::log10(shape->energy / shape->first_path_energy));
  }
  EXPECT_GT(all.size(), 55u);
  std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
  return all[all.size() / 2];
}

TEST(Impulse, IsARecordOfThisSizeWithNoiseBeforeTheFirstPathWhereRecordsHaveIt) {
  Random random(1);
  for (int i = 0; i < 50; ++i) {
    const auto taps = simulate_impulse(exchange_at(-80, 0), {}, random);
    ASSERT_EQ(taps.size(), 2 * 1016u);
    const auto shape = nlos::cir_shape(std::span(taps), std::nullopt);
    ASSERT_TRUE(shape);
    EXPECT_GT(shape->noise_rms, 18);  // dw1000-diagnostics.md section 6: 20..60 counts
    EXPECT_LT(shape->noise_rms, 63);
    EXPECT_GT(shape->first_path_idx, 725);
    EXPECT_LT(shape->first_path_idx, 770);
  }
}

TEST(Impulse, HasItsFirstPathOnTopInTheOpenAndWellUnderTheRestBehindConcrete) {
  EXPECT_LT(median_difference_db(-78, 0), 5.0);   // the 6 dB test of eq 5.6 and 5.7 says LOS
  EXPECT_GT(median_difference_db(-88, 28), 6.0);  // and NLOS behind two concrete walls
}

TEST(Impulse, IsTheSameWithTheSameSeed) {
  Random a(5), b(5), c(6);
  const auto first = simulate_impulse(exchange_at(-80, 7), {}, a);
  EXPECT_EQ(first, simulate_impulse(exchange_at(-80, 7), {}, b));
  EXPECT_NE(first, simulate_impulse(exchange_at(-80, 7), {}, c));
}

TEST(Antenna, HasItsTwoLobesAt120And250DegreesAndADeepNullInFront) {
  EXPECT_NEAR(turn_gain_db(120 * k_degree, 8), 0, 0.05);  // Fig 8.4
  EXPECT_NEAR(turn_gain_db(250 * k_degree, 8), 0, 0.05);
  EXPECT_LT(turn_gain_db(5 * k_degree, 8), -7);
  EXPECT_LT(turn_gain_db(185 * k_degree, 8), -3);
  EXPECT_GT(turn_gain_db(185 * k_degree, 8), turn_gain_db(5 * k_degree, 8));
}

TEST(Antenna, HearsBestOnItsOwnLevel) {
  EXPECT_NEAR(dipole_gain_db(0), 0, 1e-9);
  // Half-wave dipole at 45 degrees: cos(90 sin 45) / cos 45 = cos(63.64 deg) / 0.70711 = 0.6279 -> -4.042 dB.
  EXPECT_NEAR(dipole_gain_db(45 * k_degree), -4.042, 0.01);
  EXPECT_EQ(dipole_gain_db(90 * k_degree), -20);
}

TEST(LevelBias, GoesThroughTheMakersTable) {
  // dw1000-diagnostics.md section 4, check values for 500 MHz, PRF 64.
  EXPECT_NEAR(level_bias_m(-60), -0.110, 1e-9);
  EXPECT_NEAR(level_bias_m(-70), -0.0755, 1e-9);
  EXPECT_NEAR(level_bias_m(-77), 0, 1e-9);
  EXPECT_NEAR(level_bias_m(-78.5), 0.01575, 1e-9);
  EXPECT_NEAR(level_bias_m(-88.3), 0.06785, 1e-9);
  EXPECT_NEAR(level_bias_m(-99), 0.086, 1e-9);
}

TEST(Exchange, IsStrongestOnTheLevelOfTheAnchorAndWithALobeTowardsIt) {
  RadioOptions options;
  options.turn_lobe_db = 8;
  options.height_lobe = true;
  const Terminal anchor{{0, 10, 3}, {}, 0};  // due north
  const auto level = [&](double height_m, double heading_deg) {
    return mean_level_dbm(options, {{0, 0, height_m}, heading_deg * k_degree, 0}, anchor, {});
  };
  EXPECT_GT(level(3, 120), level(4.5, 120));
  EXPECT_GT(level(3, 120), level(1.5, 120));
  EXPECT_NEAR(level(3, 120) - level(3, 0), 8, 0.3);
  EXPECT_NEAR(level(3, 120), level(3, 250), 0.1);
}

}  // namespace
}  // namespace anchord::sim::impulse_test
