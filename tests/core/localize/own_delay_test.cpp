// One anchor whose ranges are all late or early by a constant: the delay put in is the one expected.
#include "core/localize/own_delay.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::own_delay_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;
using testing::turning;

const Gate* own_delay_of(const AnchorSolution& anchor) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, "own_delay", &Gate::name);
  return at == gates.end() ? nullptr : &*at;
}

MadeFlight with_delay(std::uint64_t seed, double delay_m) {
  MadeFlight made = turning(seed);
  made.anchors.push_back({15, -6, 4});
  made.delays_m = {delay_m};
  return made;
}

TEST(OwnDelay, HoldsBackTheOneAnchorWithADelayOfItsOwn) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    for (const double delay_m : {-0.6, 0.5, 0.8, 1.2}) {
      const auto s = solve_flight(make_flight(with_delay(seed, delay_m))).value();
      const Gate* gate = own_delay_of(s.anchors[0]);
      ASSERT_TRUE(gate);
      EXPECT_FALSE(gate->passed) << gate->why;
      EXPECT_NEAR(gate->value.value_or(0), std::abs(delay_m), 0.25);
      EXPECT_NE(gate->why.find(delay_m > 0 ? "m too long" : "m too short"), std::string::npos) << gate->why;
      EXPECT_NE(s.anchors[0].estimate.reason.find("check its antenna delay"), std::string::npos);
      EXPECT_FALSE(s.anchors[0].estimate.acceptable());
      for (std::size_t i = 1; i < s.anchors.size(); ++i) {
        ASSERT_TRUE(own_delay_of(s.anchors[i]));
        EXPECT_TRUE(own_delay_of(s.anchors[i])->passed) << own_delay_of(s.anchors[i])->why;
      }
    }
  }
}

TEST(OwnDelay, IsNoneWhereAllAnchorsShareIt) {
  for (const std::uint64_t seed : {4, 5, 6}) {
    MadeFlight made = turning(seed);
    made.bias_m = 0.6;
    made.delays_m = {0.03, -0.03, 0.02, -0.04};  // unit to unit
    const auto s = solve_flight(make_flight(made)).value();
    for (const AnchorSolution& anchor : s.anchors) {
      ASSERT_TRUE(own_delay_of(anchor));
      EXPECT_TRUE(own_delay_of(anchor)->passed) << own_delay_of(anchor)->why;
      EXPECT_TRUE(anchor.estimate.acceptable()) << anchor.estimate.reason;
    }
  }
}

}  // namespace
}  // namespace anchord::own_delay_test
