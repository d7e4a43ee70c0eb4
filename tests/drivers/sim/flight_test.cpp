#include "drivers/sim/flight.hpp"

#include <gtest/gtest.h>

#include <GeographicLib/LocalCartesian.hpp>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace anchord::sim::flight_test {
namespace {

SimulatedFlight fly(std::uint64_t seed, double duration_s = 60) {
  SimulationOptions options;
  options.seed = seed;
  options.duration_s = duration_s;
  return simulate_flight(demonstration_world(), options).value();
}

std::uint64_t digest(const SimulatedFlight& flight) {
  std::uint64_t hash = 1469598103934665603u;  // FNV-1a over the bits of every number
  const auto mix = [&hash](std::uint64_t value) { hash = (hash ^ value) * 1099511628211u; };
  for (const Range& r : flight.data.ranges) {
    mix(static_cast<std::uint64_t>(r.time.ns));
    mix(r.anchor.value);
    mix(std::bit_cast<std::uint64_t>(r.distance_m));
  }
  for (const Fix& f : flight.data.fixes) {
    mix(static_cast<std::uint64_t>(f.time.ns));
    mix(std::bit_cast<std::uint64_t>(f.position.lat_deg));
    mix(std::bit_cast<std::uint64_t>(f.position.height_m));
  }
  return hash;
}

TEST(SimulatedFlight, IsTheSameBitForBitWithTheSameSeedAndAnotherWithAnother) {
  EXPECT_EQ(digest(fly(5)), digest(fly(5)));
  EXPECT_NE(digest(fly(5)), digest(fly(6)));
}

TEST(SimulatedFlight, StaysOutsideTheBuildingAtThreeHeightsWithoutJumps) {
  const World world = demonstration_world();
  const SimulationOptions options;
  Eigen::Vector3d last_m = orbit_m(world, options, 0);
  double lowest_m = 1e9, highest_m = -1e9, longest_step_m = 0;
  for (int i = 1; i <= 20'000; ++i) {
    const Eigen::Vector3d at_m = orbit_m(world, options, i / 20'000.0);
    const double outside_m = std::hypot(std::max({-at_m.x(), at_m.x() - world.length_m, 0.0}),
                                        std::max({-at_m.y(), at_m.y() - world.width_m, 0.0}));
    ASSERT_NEAR(outside_m, options.clearance_m, 1e-6) << "at share " << i / 20'000.0;
    longest_step_m = std::max(longest_step_m, (at_m - last_m).norm());
    lowest_m = std::min(lowest_m, at_m.z());
    highest_m = std::max(highest_m, at_m.z());
    last_m = at_m;
  }
  EXPECT_LT(longest_step_m, 0.05);
  EXPECT_EQ(lowest_m, 3.5);
  EXPECT_EQ(highest_m, 14.0);
}

TEST(SimulatedFlight, StatesASigmaThatItsFixesKeep) {
  const SimulatedFlight flight = fly(11, 200);
  const World world = demonstration_world();
  const GeographicLib::LocalCartesian site(world.origin.lat_deg, world.origin.lon_deg, world.origin.height_m);
  SimulationOptions options;
  options.duration_s = 200;
  double sum = 0;
  int n = 0, floats = 0;
  for (const Fix& fix : flight.data.fixes) {
    Eigen::Vector3d at_m;
    site.Forward(fix.position.lat_deg, fix.position.lon_deg, fix.position.height_m, at_m.x(), at_m.y(),
                 at_m.z());
    const double share = std::min(seconds_between(options.start, fix.time) / options.duration_s, 1.0);
    const Eigen::Vector3d error_m = at_m - orbit_m(world, options, share);
    sum += error_m.dot(fix.covariance_m2->inverse() * error_m) / 3;
    floats += fix.fix == FixClass::rtk_float;
    ++n;
  }
  EXPECT_EQ(n, 2001);
  EXPECT_NEAR(floats, 0.04 * n, 2);
  EXPECT_NEAR(sum / n, 1.0, 0.35);  // correlated over 15 s: some 40 independent samples of 3 axes, 3 sigma
}

TEST(SimulatedFlight, HasEveryAnchorAndEveryKindOfTrouble) {
  const SimulatedFlight flight = fly(2, 210);
  std::map<NetworkId, int> heard;
  int zeros = 0, behind_walls = 0;
  for (const Range& range : flight.data.ranges) {
    ++heard[range.anchor];
    zeros += range.distance_m == 0;
    behind_walls += !*range.truth->los;
  }
  EXPECT_EQ(heard.size(), 6u);
  for (const auto& [id, count] : heard) EXPECT_GT(count, 300) << to_string(id);
  EXPECT_GT(zeros, 5);
  EXPECT_GT(behind_walls, 500);
  EXPECT_LT(flight.data.ranges.size(), 6300u) << "nothing was lost";
}

TEST(SimulatedFlight, RefusesNonsense) {
  for (const double bad :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    SimulationOptions options;
    options.duration_s = bad;
    EXPECT_FALSE(simulate_flight(demonstration_world(), options)) << bad;
    options = {};
    options.range_rate_hz = bad;
    EXPECT_FALSE(simulate_flight(demonstration_world(), options)) << bad;
  }
  EXPECT_FALSE(simulate_flight(World{}, SimulationOptions{})) << "a world without anchors";
}

}  // namespace
}  // namespace anchord::sim::flight_test
