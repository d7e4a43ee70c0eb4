// A track whose positions are off by one constant vector from some instant on, and tracks that only have
// gaps. Ranges and truth are made from a path in closed form: the shift put in is the shift to be found.
#include "core/localize/track_shift.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::track_shift_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;
using testing::turning;

double time_s(const Fix& fix) { return seconds_between(UtcTime::from_seconds(0), fix.time); }

void lose_fix(FlightData& flight, double from_s, double to_s) {
  for (Fix& fix : flight.fixes)
    if (time_s(fix) >= from_s && time_s(fix) < to_s) fix.fix = FixClass::rtk_float;
}

void shift(FlightData& flight, double from_s, double to_s, const Eigen::Vector3d& by_m) {
  for (Fix& fix : flight.fixes)
    if (time_s(fix) >= from_s && time_s(fix) < to_s) fix.local_m += by_m;
}

const Gate* shift_gate(const AnchorSolution& anchor) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, "track_shift", &Gate::name);
  return at == gates.end() ? nullptr : &*at;
}

/// Every anchor is withheld by the gate, which says when and by how much.
void expect_withheld(const FlightSolution& solution, const char* size, const char* when) {
  ASSERT_EQ(solution.anchors.size(), 4U);
  for (const AnchorSolution& anchor : solution.anchors) {
    const Gate* gate = shift_gate(anchor);
    ASSERT_NE(gate, nullptr);
    EXPECT_FALSE(gate->passed) << gate->why;
    EXPECT_GT(gate->value.value(), gate->limit);
    EXPECT_NE(gate->why.find(size), std::string::npos) << gate->why;
    EXPECT_NE(gate->why.find(when), std::string::npos) << gate->why;
    EXPECT_NE(gate->why.find("exclude the positions"), std::string::npos) << gate->why;
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
}

TEST(TrackShift, WithholdsEveryAnchorWhereTheTrackComesBackElsewhere) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    FlightData flight = make_flight(turning(seed));
    lose_fix(flight, 50, 58);
    shift(flight, 50, 1e9, {0, 0, 1.0});
    expect_withheld(solve_flight(flight).value(), "mostly in height, from 00:00:58 UTC on, after 8.1 s",
                    "00:00:58");
    FlightData aside = make_flight(turning(seed));
    lose_fix(aside, 70, 73);
    shift(aside, 70, 1e9, {0.4, -0.3, 0});
    expect_withheld(solve_flight(aside).value(), "mostly horizontally", "00:01:13");
  }
}

TEST(TrackShift, FindsAWrongFixThatDoesNotLast) {
  FlightData flight = make_flight(turning(4));
  lose_fix(flight, 40, 44);
  lose_fix(flight, 75, 79);
  shift(flight, 40, 75, {0, 0, 0.8});
  expect_withheld(solve_flight(flight).value(), "mostly in height, from 00:00:44 to 00:01:15 UTC",
                  "00:00:44");
}

TEST(TrackShift, FindsAStepBetweenTwoFixedPositions) {
  // Half a metre in a tenth of a second is within what check_track allows for swings and stumbling logs.
  FlightData flight = make_flight(turning(5));
  shift(flight, 60, 1e9, {0, 0, 0.5});
  expect_withheld(solve_flight(flight).value(), "where it steps between two positions", "00:01:00");
}

TEST(TrackShift, FindsABaseThatWasSetUpAnewWhileTheFixHeld) {
  FlightData flight = make_flight(turning(6));
  for (Fix& fix : flight.fixes) {
    const double t_s = time_s(fix);
    fix.correction_age_s = t_s > 40 && t_s < 60 ? t_s - 40 : 1.0;
    // The receiver goes over to the new base in some seconds.
    fix.local_m.z() += 0.8 * std::clamp((t_s - 60) / 3.0, 0.0, 1.0);
  }
  expect_withheld(solve_flight(flight).value(), "corrections", "00:01:00");
}

TEST(TrackShift, LeavesFlightsWithHarmlessGapsAccepted) {
  int n = 0, accepted = 0;
  for (const std::uint64_t seed : {11, 12, 13, 14, 15, 16, 17, 18}) {
    FlightData flight = make_flight(turning(seed));
    const FlightSolution whole = solve_flight(flight).value();
    for (const double at_s : {20.0, 45.0, 50.0, 80.0, 95.0}) lose_fix(flight, at_s, at_s + 2.5);
    const FlightSolution solution = solve_flight(flight).value();
    for (std::size_t i = 0; i < solution.anchors.size(); ++i) {
      const Estimate& estimate = solution.anchors[i].estimate;
      const Gate* gate = shift_gate(solution.anchors[i]);
      ASSERT_NE(gate, nullptr);
      EXPECT_TRUE(gate->passed) << gate->why;
      EXPECT_EQ(shift_gate(whole.anchors[i]), nullptr) << "without a gap nothing is asked";
      EXPECT_LT(estimate.v95_m, 1.25 * whole.anchors[i].estimate.v95_m);
      ++n;
      accepted += estimate.acceptable() ? 1 : 0;
    }
  }
  EXPECT_EQ(accepted, n);
}

TEST(TrackShift, IsInTheRegionWhereTheRangesCannotShowIt) {
  // Of ten seconds after the gap: little tells whether they are off, and little depends on it.
  FlightData late = make_flight(turning(21));
  const FlightSolution whole = solve_flight(late).value();
  lose_fix(late, 104, 110);
  const FlightSolution with_gap = solve_flight(late).value();
  // Two anchors received before the gap only, two after it only: their frames may be two.
  FlightData apart = make_flight(turning(21));
  lose_fix(apart, 58, 62);
  std::erase_if(apart.ranges, [](const Range& range) {
    const bool first_two = range.anchor == NetworkId{0x6000} || range.anchor == NetworkId{0x6001};
    return first_two == (seconds_between(UtcTime::from_seconds(0), range.time) > 60);
  });
  const FlightSolution nothing_asked = solve_flight(apart).value();
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT(with_gap.anchors[i].estimate.h95_m, 1.7 * whole.anchors[i].estimate.h95_m);
    // One flight in twenty has a shift of 1 m, and half of it is on either side: 0.16 m.
    EXPECT_GT(nothing_asked.anchors[i].estimate.best->covariance_m2(2, 2), 0.15 * 0.15);
  }
  EXPECT_NE(std::ranges::find_if(
                nothing_asked.notes,
                [](const std::string& note) { return note.find("would not show") != std::string::npos; }),
            nothing_asked.notes.end());
}

}  // namespace
}  // namespace anchord::track_shift_test
