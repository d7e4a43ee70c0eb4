// Two antennas on one aircraft have two vertical arms.
#include <gtest/gtest.h>

#include <cmath>

#include "core/localize/flight_solver.hpp"
#include "flight_support.hpp"

namespace anchord::antennas_test {
namespace {

using testing::MadeFlight;

/// One flight with a tag 0.12 m above where it is declared and one 0.08 m below.
FlightData two_tags(std::uint64_t seed) {
  MadeFlight m;
  m.seed = seed;
  m.lever_up_m = 0.12;
  m.duration_s = 480;  // the differences are expected to be small: it takes a while to say otherwise
  FlightData flight = testing::make_flight(m);
  m.seed = seed + 1000;
  m.lever_up_m = -0.08;
  const FlightData below = testing::make_flight(m);
  flight.mission.tags.push_back({NetworkId{0x6e02}, 0, {0, 0, 0}});
  for (Range range : below.ranges) {
    range.tag = NetworkId{0x6e02};
    range.time.ns += 37'000;  // so that the two do not range in one instant
    flight.ranges.push_back(range);
  }
  return flight;
}

TEST(Antennas, OfOneAircraftHaveAVerticalArmEach) {
  const auto solved = solve_flight(two_tags(1));
  ASSERT_TRUE(solved.has_value());
  const auto& arms = solved.value().shared.lever_up_by_antenna;
  ASSERT_EQ(arms.size(), 2u);
  EXPECT_EQ(arms[0].tag, NetworkId{0x6e01});
  EXPECT_EQ(arms[1].tag, NetworkId{0x6e02});
  // An upright flight cannot tell an arm from the height of all anchors; the difference of two it can.
  EXPECT_NEAR(arms[0].up_m.value - arms[1].up_m.value, 0.20, 0.05);  // drawn together by their prior
  EXPECT_LT(std::abs(arms[0].up_m.value - 0.12), 3 * arms[0].up_m.sigma);
  EXPECT_LT(std::abs(arms[1].up_m.value + 0.08), 3 * arms[1].up_m.sigma);
  for (const auto& anchor : solved.value().anchors) EXPECT_LT(anchor.residual_scale_m, 0.056);
}

TEST(Antennas, AloneHaveTheArmTheKitShares) {
  const auto solved = solve_flight(testing::make_flight(MadeFlight{}));
  ASSERT_TRUE(solved.has_value());
  const auto& shared = solved.value().shared;
  ASSERT_EQ(shared.lever_up_by_antenna.size(), 1u);
  EXPECT_EQ(shared.lever_up_by_antenna[0].up_m.value, shared.lever_up_m.value);
  EXPECT_EQ(shared.lever_up_by_antenna[0].up_m.sigma, shared.lever_up_m.sigma);
}

TEST(Antennas, OfTwoTagsAreSolvedByCeresToo) {
  const FlightData flight = two_tags(2);
  const auto own = solve_flight(flight);
  FlightOptions options;
  options.method = Method::levenberg_marquardt;
  const auto ceres = solve_flight(flight, options);
  ASSERT_TRUE(own.has_value() && ceres.has_value());
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(own.value().shared.lever_up_by_antenna[i].up_m.value,
                ceres.value().shared.lever_up_by_antenna[i].up_m.value, 0.01);
  }
}

TEST(Antennas, BeyondFourShareTheCommonArm) {
  FlightData flight = two_tags(3);
  for (std::size_t i = 0; i < flight.ranges.size(); ++i)
    flight.ranges[i].antenna = static_cast<std::uint8_t>(i % 3);
  flight.mission.tags.clear();
  const auto solved = solve_flight(flight);
  ASSERT_TRUE(solved.has_value());
  const auto& shared = solved.value().shared;
  ASSERT_EQ(shared.lever_up_by_antenna.size(), 6u);
  EXPECT_EQ(shared.lever_up_by_antenna[5].up_m.value, shared.lever_up_m.value);
}

}  // namespace
}  // namespace anchord::antennas_test
