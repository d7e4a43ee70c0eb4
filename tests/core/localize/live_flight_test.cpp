#include "core/localize/live_flight.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord {
namespace {

using testing::MadeFlight;
using testing::make_flight;

/// Rows in order of time, as a stream would bring them.
void play(LiveFlight& live, const FlightData& flight) {
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  std::size_t next = 0;
  for (const Fix& fix : flight.fixes) {
    while (next < ranges.size() && ranges[next].time < fix.time) live.add(ranges[next++]);
    live.add(fix);
  }
  while (next < ranges.size()) live.add(ranges[next++]);
}

TEST(LiveFlight, ConvergesToTheBatchAnswer) {
  const MadeFlight made;
  const auto flight = make_flight(made);
  LiveFlight live(flight.mission);
  play(live, flight);
  live.finish();
  const auto batch = solve_flight(flight);
  ASSERT_TRUE(batch);
  const auto estimates = live.estimates();
  ASSERT_EQ(estimates.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(estimates[i].best) << estimates[i].reason;
    EXPECT_EQ(estimates[i].verdict, Verdict::ok) << estimates[i].reason;
    EXPECT_LT((estimates[i].best->position.m - batch.value().anchors[i].estimate.best->position.m).norm(),
              0.05);
  }
}

TEST(LiveFlight, DecidesARangeOnceTheFixAfterItHasCome) {
  const auto flight = make_flight(MadeFlight{});
  LiveFlight live(flight.mission);
  live.add(flight.fixes[5]);
  Range range = flight.ranges.front();
  range.time = UtcTime::from_seconds(0.55);
  live.add(range);
  EXPECT_TRUE(live.take_ranges().empty());
  live.add(flight.fixes[6]);
  const auto decided = live.take_ranges();
  ASSERT_EQ(decided.size(), 1U);
  EXPECT_TRUE(decided[0].used()) << decided[0].refused;
  EXPECT_TRUE(decided[0].tag_enu_m);
}

TEST(LiveFlight, TakesRowsOutOfOrder) {
  const MadeFlight made;
  auto flight = make_flight(made);
  // Neighbours swapped all along, and every range a little late.
  for (std::size_t i = 0; i + 1 < flight.fixes.size(); i += 3)
    std::swap(flight.fixes[i], flight.fixes[i + 1]);
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  for (std::size_t i = 0; i + 1 < ranges.size(); i += 2) std::swap(ranges[i], ranges[i + 1]);
  LiveFlight live(flight.mission);
  std::size_t next = 0;
  for (const Fix& fix : flight.fixes) {
    live.add(fix);
    while (next < ranges.size() && ranges[next].time.seconds() < fix.time.seconds() - 0.5)
      live.add(ranges[next++]);
  }
  live.finish();
  const auto estimates = live.estimates();
  ASSERT_EQ(estimates.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    ASSERT_TRUE(estimates[i].best);
    EXPECT_LT((estimates[i].best->position.m - made.anchors[i]).norm(), 0.1);
  }
}

TEST(LiveFlight, RefusesBadRowsWithAReason) {
  const auto flight = make_flight(MadeFlight{});
  LiveFlight live(flight.mission);
  Range zero = flight.ranges.front();
  zero.distance_m = 0;
  live.add(zero);
  Range far = flight.ranges.front();
  far.distance_m = 1e5;
  live.add(far);
  Range early = flight.ranges.front();
  early.time = UtcTime::from_seconds(-50);
  live.add(flight.fixes[0]);
  live.add(early);
  live.add(early);
  const auto results = live.take_ranges();
  ASSERT_EQ(results.size(), 4U);
  EXPECT_EQ(results[0].refused, "zero_range");
  EXPECT_EQ(results[1].refused, "out_of_bounds");
  EXPECT_EQ(results[2].refused, "outside_track");
  EXPECT_EQ(results[3].refused, "duplicate");
}

TEST(LiveFlight, DoesNotWaitForEverWithoutFixes) {
  const auto flight = make_flight(MadeFlight{});
  LiveOptions options;
  options.max_waiting = 100;
  LiveFlight live(flight.mission, options);
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  for (const Range& range : ranges) live.add(range);
  std::size_t refused = 0;
  for (const auto& result : live.take_ranges()) refused += result.used() ? 0 : 1;
  EXPECT_GT(refused, 0U);
  EXPECT_LE(refused, 100U);  // nobody collected: the newest are kept
}

TEST(LiveFlight, UpdatesEachAnchorAtMostTwiceASecondOfMeasurementTime) {
  const auto flight = make_flight(MadeFlight{});
  LiveFlight live(flight.mission);
  std::size_t updates = 0;
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  std::size_t next = 0;
  for (const Fix& fix : flight.fixes) {
    while (next < ranges.size() && ranges[next].time < fix.time) live.add(ranges[next++]);
    live.add(fix);
    updates += live.take_estimates().size();
  }
  EXPECT_LE(updates, 4U * 2U * 121U);
  EXPECT_GT(updates, 4U * 100U);
}

TEST(LiveFlight, BlamesALevelFlightsGeometryAndNotItsRanges) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    MadeFlight made;
    made.height_swing_m = 0;
    made.duration_s = 40;
    made.noise_m = 0.1;
    made.seed = seed;
    const auto flight = make_flight(made);
    LiveFlight live(flight.mission);
    auto ranges = flight.ranges;
    std::ranges::stable_sort(ranges, {}, &Range::time);
    std::size_t next = 0;
    for (const Fix& fix : flight.fixes) {
      while (next < ranges.size() && ranges[next].time < fix.time) live.add(ranges[next++]);
      live.add(fix);
      for (const Estimate& estimate : live.take_estimates()) {
        const auto where = to_string(estimate.anchor) + " at " + std::to_string(fix.time.seconds()) + " s: ";
        EXPECT_NE(estimate.verdict, Verdict::ok) << where << "v95 " << estimate.v95_m << " m";
        EXPECT_NE(estimate.verdict, Verdict::diverged) << where << estimate.reason;
      }
    }
  }
}

TEST(LiveFlight, PlacesAnRtkFlightOnTheGlobe) {
  MadeFlight made;
  made.frame = TrackFrame::wgs84;
  made.duration_s = 40;
  const auto flight = make_flight(made);
  LiveFlight live(flight.mission, {.origin = made.origin});
  play(live, flight);
  live.finish();
  ASSERT_TRUE(live.origin());
  ASSERT_TRUE(live.pose());
  EXPECT_GT(live.pose()->speed_mps.value(), 0.5);
  for (const auto& e : live.estimates()) {
    ASSERT_TRUE(e.best);
    EXPECT_TRUE(e.best->wgs84);
  }
}

}  // namespace
}  // namespace anchord
