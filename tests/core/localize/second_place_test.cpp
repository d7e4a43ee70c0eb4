// Anchors of which a minority of the ranges agrees on another place. Where each range came from is put in:
// what is expected is the place, the instant and the anchor put in, not what the solver makes of them.
#include "core/localize/second_place.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <regex>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::second_place_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;
using testing::turning;

const Gate& second_place_of(const AnchorSolution& anchor) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, "second_place", &Gate::name);
  EXPECT_NE(at, gates.end());
  static const Gate none;
  return at == gates.end() ? none : *at;
}

/// The flight with its anchors as made, and from a share of its duration on as `later`.
FlightData changed_at(double share, const MadeFlight& made, const MadeFlight& later) {
  FlightData flight = make_flight(made);
  const FlightData other = make_flight(later);
  for (std::size_t i = 0; i < flight.ranges.size(); ++i)
    if (flight.ranges[i].time.seconds() > share * made.duration_s) flight.ranges[i] = other.ranges[i];
  return flight;
}

MadeFlight with_anchor_moved(MadeFlight made, const Eigen::Vector3d& by_m) {
  made.anchors[0] += by_m;
  return made;
}

void expect_withheld(const AnchorSolution& anchor, const char* pattern) {
  const Gate& gate = second_place_of(anchor);
  EXPECT_FALSE(gate.passed) << gate.why;
  EXPECT_GT(gate.value.value_or(0), gate.limit);
  EXPECT_TRUE(std::regex_search(gate.why, std::regex(pattern))) << gate.why;
  EXPECT_NE(anchor.estimate.reason.find(gate.why), std::string::npos) << anchor.estimate.reason;
  EXPECT_FALSE(anchor.estimate.acceptable());
}

TEST(SecondPlace, HoldsBackAnAnchorThatMovedLateInTheFlightAndSaysSinceWhen) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    for (const Eigen::Vector3d& by_m : {Eigen::Vector3d(1.7, 1.0, 0.2), Eigen::Vector3d(-6, 5, -1)}) {
      const MadeFlight made = turning(seed);
      const auto s = solve_flight(changed_at(0.75, made, with_anchor_moved(made, by_m))).value();
      // Three quarters of 120 s.
      expect_withheld(s.anchors[0], "from 00:01:(29|3[0-3]) UTC on: was it moved");
      for (std::size_t i = 1; i < s.anchors.size(); ++i)
        EXPECT_TRUE(s.anchors[i].estimate.acceptable()) << s.anchors[i].estimate.reason;
    }
  }
}

TEST(SecondPlace, SaysUntilWhenAnAnchorThatMovedEarlyStoodElsewhere) {
  const MadeFlight made = turning(4);
  const auto s = solve_flight(changed_at(0.25, made, with_anchor_moved(made, {2.5, -3, 0}))).value();
  expect_withheld(s.anchors[0], "until 00:00:(29|3[0-3]) UTC");
}

TEST(SecondPlace, NamesTheAnchorThatAnotherWasExchangedWith) {
  const MadeFlight made = turning(5);
  MadeFlight later = made;
  std::swap(later.anchors[0], later.anchors[1]);
  const auto s = solve_flight(changed_at(0.7, made, later)).value();
  expect_withheld(s.anchors[0], "the place of anchor 0x6001, .* exchanged");
  expect_withheld(s.anchors[1], "the place of anchor 0x6000, .* exchanged");
  EXPECT_TRUE(s.anchors[2].estimate.acceptable());
  EXPECT_TRUE(s.anchors[3].estimate.acceptable());
}

TEST(SecondPlace, HoldsBackAllAnchorsWhoseAddressesWereShifted) {
  const MadeFlight made = turning(6);
  MadeFlight later = made;
  std::ranges::rotate(later.anchors, later.anchors.begin() + 1);
  const auto s = solve_flight(changed_at(0.7, made, later)).value();
  for (const AnchorSolution& anchor : s.anchors) expect_withheld(anchor, "the place of anchor 0x600[0-3], ");
}

/// Three ranges of five by way of a wall 4 m behind the anchor, as if it stood behind it.
TEST(SecondPlace, HoldsBackAnAnchorThatIsMostlyReceivedByAReflection) {
  for (const std::uint64_t seed : {7, 8, 9}) {
    const MadeFlight made = turning(seed);
    const FlightData mirrored = make_flight(with_anchor_moved(made, {8, 0, 0}));
    FlightData flight = make_flight(made);
    for (std::size_t i = 0; i < flight.ranges.size(); ++i)
      if (i % 5 < 3) flight.ranges[i] = mirrored.ranges[i];
    const auto s = solve_flight(flight).value();
    EXPECT_GT((s.anchors[0].estimate.best->position.m - made.anchors[0]).norm(), 4) << "else nothing to hold";
    expect_withheld(s.anchors[0], "shorter than from here: .* reflection");
    for (std::size_t i = 1; i < s.anchors.size(); ++i)
      EXPECT_TRUE(second_place_of(s.anchors[i]).passed) << second_place_of(s.anchors[i]).why;
  }
}

TEST(SecondPlace, IsLookedForAtTheHeightThatIsHeld) {
  MadeFlight made = turning(10);
  for (Eigen::Vector3d& at_m : made.anchors) at_m.z() = 2;
  FlightOptions options;
  options.dims = Dims::two;
  options.anchor_height_m = 2;
  const auto s =
      solve_flight(changed_at(0.75, made, with_anchor_moved(made, {1.7, 1.4, 0})), options).value();
  expect_withheld(s.anchors[0], "another place 2\\.[0-5] m away from");
  EXPECT_TRUE(second_place_of(s.anchors[1]).passed);
}

/// Walls make ranges late by amounts of their own: nothing agrees, or not on a place far away.
TEST(SecondPlace, PassesAnchorsBehindWalls) {
  for (const std::uint64_t seed : {11, 12, 13, 14}) {
    MadeFlight made = turning(seed);
    made.nlos_share = 0.3;
    FlightData flight = make_flight(made);
    for (Range& range : flight.ranges) {
      // North of the anchor 0.6 m late, for every tenth of the flight that a wall is in the way.
      if (range.anchor == NetworkId{0x6000} && path(made, range.time.seconds()).y() > 10)
        range.distance_m += 0.6;
    }
    const auto s = solve_flight(flight).value();
    for (const AnchorSolution& anchor : s.anchors)
      EXPECT_TRUE(second_place_of(anchor).passed) << seed << ' ' << second_place_of(anchor).why;
  }
}

}  // namespace
}  // namespace anchord::second_place_test
