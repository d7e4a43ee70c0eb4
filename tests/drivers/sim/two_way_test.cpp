// Equations 2.1 to 2.4 of the dissertation, by hand and in the simulated radio.
#include "drivers/sim/two_way.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "drivers/sim/radio.hpp"

namespace anchord::sim::two_way_test {
namespace {

constexpr double k_light_mps = 299'792'458.0;

TEST(TwoWayRanging, HalvesTheRoundLessTheReply) {
  // 10 m: 33.356 ns there, as much back, 300 us between.
  const double flight_s = 10 / k_light_mps;
  EXPECT_NEAR(two_way_distance_m(300e-6 + 2 * flight_s, 300e-6), 10, 1e-9);
  EXPECT_NEAR(double_sided_distance_m(300e-6 + 2 * flight_s, 200e-6, 200e-6 + 2 * flight_s, 300e-6), 10,
              1e-9);
}

TEST(TwoWayRanging, IsWrongByHalfTheReplyTimesTheDifferenceOfTheCrystals) {
  // 290 us x 20 ppm / 2 = 2.9 ns: 0.8694 m.
  EXPECT_NEAR(two_way_error_m(290e-6, 12e-6, -8e-6), 0.869398, 1e-6);
  const TwoWayExchange single{TwoWayScheme::single_sided, 290e-6, 290e-6};
  EXPECT_NEAR(clocked_distance_m(single, 10, 12e-6, -8e-6) - 10, 0.869398, 2e-4);  // and 12 ppm of 10 m
  EXPECT_NEAR(clocked_distance_m(single, 10, 12e-6, 12e-6) - 10, 12e-6 * 10, 1e-9);
}

TEST(TwoWayRanging, DoubleSidedIsWrongByAQuarterOfTheDifferenceOfTheReplies) {
  // 10 us x 20 ppm / 4 = 50 ps: 14.99 mm.
  EXPECT_NEAR(double_sided_error_m(10e-6, 12e-6, -8e-6), 0.0149896, 1e-7);
  const TwoWayExchange uneven{TwoWayScheme::double_sided, 290e-6, 300e-6};
  EXPECT_NEAR(clocked_distance_m(uneven, 10, 12e-6, -8e-6) - 10, 0.0149896, 1e-4);
  const TwoWayExchange turned{TwoWayScheme::double_sided, 300e-6, 290e-6};
  EXPECT_NEAR(clocked_distance_m(turned, 10, 12e-6, -8e-6) - 10, -0.0149896, 1e-4);
}

TEST(TwoWayRanging, DoubleSidedWithEvenRepliesHasTheMeanClockErrorOfTheFlightLeft) {
  // (12 + (-8)) / 2 = 2 ppm of 100 m.
  EXPECT_NEAR(clocked_distance_m({}, 100, 12e-6, -8e-6) - 100, 2e-4, 1e-9);
}

TEST(Exchange, ReportsWhatTheClocksOfBothEndsMakeOfIt) {
  RadioOptions options;
  options.range_sigma_m = options.shared_bias_m = options.anchor_bias_sigma_m = 0;
  options.loss_chance = options.zero_chance = 0;
  options.two_way = {TwoWayScheme::single_sided, 290e-6, 290e-6};
  Random random(1);
  const Terminal tag{{0, 0, 0}, {}, 0, 12}, anchor{{10, 0, 0}, {}, 0, -8};
  const auto exchange = simulate_exchange(World{}, options, tag, anchor, random);
  ASSERT_TRUE(exchange.has_value());
  EXPECT_NEAR(exchange->distance_m - exchange->truth_m, two_way_error_m(290e-6, 12e-6, -8e-6), 2e-4);
  options.two_way.scheme = TwoWayScheme::double_sided;
  const auto better = simulate_exchange(World{}, options, tag, anchor, random);
  ASSERT_TRUE(better.has_value());
  EXPECT_NEAR(better->distance_m, better->truth_m, 2e-4);
}

}  // namespace
}  // namespace anchord::sim::two_way_test
