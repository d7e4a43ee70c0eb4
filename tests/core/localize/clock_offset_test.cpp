// Ranges whose clock is seconds off that of the track. Expected values are the offsets they were made with.
#include "core/localize/clock_offset.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::clock_offset_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

FlightData with_clock_off(const MadeFlight& made, double offset_s) {
  FlightData flight = make_flight(made);
  for (Range& range : flight.ranges) range.time.ns += static_cast<std::int64_t>(std::llround(offset_s * 1e9));
  return flight;
}

/// The gate `clock` of the flight as its notes have it, which is there also where no anchor has a place.
std::string clock_note(const FlightSolution& solution) {
  const auto at = std::ranges::find_if(
      solution.notes, [](const std::string& note) { return note.find("the clock of") != std::string::npos; });
  return at == solution.notes.end() ? std::string{} : *at;
}

TEST(ClockOffset, OfGpsTimeAgainstUtcIsNamedAndHoldsEveryAnchorBack) {
  for (const double offset_s : {18.0, -18.0}) {
    const FlightSolution solution = solve_flight(with_clock_off(MadeFlight{}, offset_s)).value();
    const std::string note = clock_note(solution);
    EXPECT_NE(note.find(offset_s > 0 ? "18.0 s before their times" : "18.0 s after their times"),
              std::string::npos)
        << note;
    EXPECT_NE(note.find("GPS time is 18 s ahead of UTC"), std::string::npos) << note;
    for (const auto& anchor : solution.anchors) EXPECT_FALSE(anchor.estimate.acceptable()) << offset_s;
  }
}

TEST(ClockOffset, IsFoundToATenthOfASecondUpToAMinute) {
  for (const double offset_s : {2.5, -7.3, 41.7}) {
    MadeFlight made;
    made.duration_s = 300;
    const FlightSolution solution = solve_flight(with_clock_off(made, offset_s)).value();
    char expected[40];
    std::snprintf(expected, sizeof expected, "%.1f s %s their times", std::abs(offset_s),
                  offset_s > 0 ? "before" : "after");
    EXPECT_NE(clock_note(solution).find(expected), std::string::npos) << offset_s << clock_note(solution);
    EXPECT_EQ(clock_note(solution).find("GPS"), std::string::npos);
  }
}

TEST(ClockOffset, IsNotFoundInLateRangesOrALagOfTenths) {
  MadeFlight late;
  late.nlos_share = 0.4;
  EXPECT_EQ(clock_note(solve_flight(make_flight(late)).value()), "");
  MadeFlight lag;
  lag.lag_s = 0.3;
  lag.nlos_share = 0.3;
  EXPECT_EQ(clock_note(solve_flight(make_flight(lag)).value()), "");
}

}  // namespace
}  // namespace anchord::clock_offset_test
