#include "core/localize/live_flight.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::live_flight_test {
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

TEST(LiveFlight, TakesAModelsCorrectionOffAndKeepsTheAnswerWithoutIt) {
  const auto flight = make_flight(MadeFlight{});
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  const NetworkId anchor = ranges.front().anchor;
  LiveFlight plain(flight.mission), judged(flight.mission);
  std::size_t next = 0;
  // Every range of one anchor is a twentieth too long, and told to be; beside it flies one that never was. (A
  // constant would say little: the flight finds its own bias.)
  const auto add = [&](const Range& range) {
    plain.add(range);
    Range longer = range;
    if (range.anchor != anchor) return judged.add(longer);
    RangeModel model;
    model.p_los = 0.9;
    model.bias_m = 0.05 * range.distance_m;
    longer.distance_m += *model.bias_m;
    judged.add(longer, model);
  };
  for (const Fix& fix : flight.fixes) {
    while (next < ranges.size() && ranges[next].time < fix.time) add(ranges[next++]);
    plain.add(fix), judged.add(fix);
  }
  plain.finish(), judged.finish();
  const auto results = judged.take_ranges();
  const auto told = std::ranges::find_if(
      results, [&](const RangeResult& r) { return r.used() && r.range.anchor == anchor; });
  ASSERT_NE(told, results.end());
  EXPECT_EQ(told->model->p_los, 0.9);
  // A twentieth of the true distance, give or take the bias the flight finds by itself.
  EXPECT_NEAR(told->range.distance_m - *told->corrected_m, told->range.distance_m * 0.05 / 1.05, 0.25);
  const auto with = judged.estimates(), without = plain.estimates();
  for (std::size_t i = 0; i < with.size(); ++i) {
    ASSERT_TRUE(with[i].best && without[i].best);
    EXPECT_LT((with[i].best->position.m - without[i].best->position.m).norm(), 1e-6);
    const auto moved = judged.model_shift(with[i].anchor);
    EXPECT_EQ(moved.has_value(), with[i].anchor == anchor);
  }
  EXPECT_GT(judged.model_shift(anchor)->m, 0.05);
  EXPECT_FALSE(plain.model_shift(anchor));
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

TEST(LiveFlight, SolvesNothingWhileHeldAndEveryAnchorOnceAfterwards) {
  const MadeFlight made;
  const auto flight = make_flight(made);
  LiveFlight live(flight.mission);
  live.hold(true);
  play(live, flight);
  EXPECT_TRUE(live.take_estimates().empty());
  live.hold(false);
  EXPECT_EQ(live.take_estimates().size(), made.anchors.size());
  for (const auto& estimate : live.estimates()) EXPECT_EQ(estimate.verdict, Verdict::ok) << estimate.reason;
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
  for (const auto& e : live.estimates()) {
    ASSERT_TRUE(e.best);
    EXPECT_TRUE(e.best->wgs84);
  }
}

/// Truth within this of every estimate once all rows are in.
void expect_placed(const LiveFlight& live, const MadeFlight& made, double within_m) {
  const auto estimates = live.estimates();
  ASSERT_EQ(estimates.size(), made.anchors.size());
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    ASSERT_TRUE(estimates[i].best) << estimates[i].reason;
    EXPECT_LT((estimates[i].best->position.m - made.anchors[i]).norm(), within_m);
    EXPECT_GT(estimates[i].n_used, 100U);
    EXPECT_FALSE(estimates[i].refused.contains("no_fix_in_time"));
    EXPECT_FALSE(estimates[i].refused.contains("outside_track"));
  }
}

TEST(LiveFlight, UsesRangesThatComeAfterAllFixesOfTheFlight) {
  MadeFlight made;
  made.duration_s = 60;
  const auto flight = make_flight(made);
  LiveFlight live(flight.mission);
  for (const Fix& fix : flight.fixes) live.add(fix);
  for (const Range& range : flight.ranges) live.add(range);
  expect_placed(live, made, 0.2);
}

TEST(LiveFlight, UsesRangesThatCameBeforeAllFixesOfTheFlight) {
  MadeFlight made;
  made.duration_s = 60;
  const auto flight = make_flight(made);
  LiveFlight live(flight.mission);
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  for (const Range& range : ranges) live.add(range);
  // Whoever watches is told at once that no track is there, and what became of it later.
  std::size_t told = 0;
  for (const auto& result : live.take_ranges()) told += result.refused == "no_fix_in_time" ? 1 : 0;
  EXPECT_GT(told, 0U);
  for (const Fix& fix : flight.fixes) live.add(fix);
  expect_placed(live, made, 0.2);
}

TEST(LiveFlight, UsesRangesAndFixesSentInChunksOfTurningOrder) {
  MadeFlight made;
  made.duration_s = 60;
  const auto flight = make_flight(made);
  LiveFlight live(flight.mission);
  // Eight chunks of each kind, fixes from the last to the first: the track grows at its front.
  for (std::size_t chunk = 8; chunk-- > 0;) {
    const std::size_t n = flight.fixes.size(), m = flight.ranges.size();
    for (std::size_t i = chunk * m / 8; i < (chunk + 1) * m / 8; ++i) live.add(flight.ranges[i]);
    for (std::size_t i = chunk * n / 8; i < (chunk + 1) * n / 8; ++i) live.add(flight.fixes[i]);
  }
  live.finish();
  expect_placed(live, made, 0.2);
}

TEST(LiveFlight, GoesOnFromAJointSolution) {
  MadeFlight made;
  made.bias_m = 0.4;
  auto flight = make_flight(made);
  std::ranges::stable_sort(flight.ranges, {}, &Range::time);
  FlightData half = flight;
  const UtcTime cut = flight.ranges[flight.ranges.size() / 2].time;
  std::erase_if(half.ranges, [&](const Range& range) { return range.time > cut; });
  const auto joint = solve_flight(half);
  ASSERT_TRUE(joint);
  LiveFlight live(flight.mission);
  for (const Fix& fix : flight.fixes) live.add(fix);
  for (const Range& range : half.ranges) live.add(range);
  live.adopt(joint.value(), cut);
  const auto adopted = live.estimates();
  for (std::size_t i = 0; i < adopted.size(); ++i) {
    ASSERT_TRUE(adopted[i].best);
    EXPECT_LT((adopted[i].best->position.m - joint.value().anchors[i].estimate.best->position.m).norm(),
              1e-6);
    // The kit's bias with the delay of this unit.
    EXPECT_NEAR(adopted[i].bias_m.value(), made.bias_m, 0.03);
  }
  live.take_ranges();
  for (const Range& range : flight.ranges) {
    if (range.time > cut) live.add(range);
  }
  double sum_m = 0;
  const auto results = live.take_ranges();
  ASSERT_GT(results.size(), 100U);
  for (const auto& result : results) sum_m += result.residual_m.value();
  EXPECT_LT(std::abs(sum_m / static_cast<double>(results.size())), 0.03) << "the bias is taken off";
  live.finish();
  const auto refined = live.estimates();
  for (std::size_t i = 0; i < refined.size(); ++i) {
    EXPECT_LT(refined[i].h95_m, adopted[i].h95_m) << "later ranges add something";
    EXPECT_LT((refined[i].best->position.m - made.anchors[i]).norm(), 0.15);
  }
}

/// A flight that was told a lag of 0.1 s; then fixes at 0 and 1 s and a range to anchor 7 at 0.95 s, which
/// waits.
LiveFlight with_a_range_that_waits_for_its_lag() {
  Mission mission;
  mission.frame = TrackFrame::local;
  LiveFlight live(mission, {.max_gap_s = 2, .lag_s = 0.1});
  for (const double t_s : {0.0, 1.0}) {
    Fix fix;
    fix.time = UtcTime::from_seconds(1'700'000'000 + t_s);
    fix.frame = TrackFrame::local;
    fix.fix = FixClass::rtk_fixed;
    fix.local_m = {t_s, 0, 10};
    live.add(fix);
  }
  Range range;
  range.time = UtcTime::from_seconds(1'700'000'000.95);
  range.tag = NetworkId{1};
  range.anchor = NetworkId{7};
  range.distance_m = 12;
  live.add(range);
  return live;
}

TEST(LiveFlight, UsesAWaitingRangeWhenTheJointSolutionMakesTheLagSmaller) {
  auto live = with_a_range_that_waits_for_its_lag();
  ASSERT_TRUE(live.take_ranges().empty());
  FlightSolution without_lag;
  live.adopt(without_lag, {});
  const auto told = live.take_ranges();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_TRUE(told.front().used()) << told.front().refused;
  EXPECT_NEAR(told.front().tag_enu_m.value().x(), 0.95, 1e-6);
}

TEST(LiveFlight, TellsWhatStillWaitsAtItsEndAndUsesItWhenTheFixComesAfterAll) {
  auto live = with_a_range_that_waits_for_its_lag();
  live.finish();
  const auto told = live.take_ranges();
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told.front().refused, "outside_track");
  Fix late;
  late.time = UtcTime::from_seconds(1'700'000'002);
  late.frame = TrackFrame::local;
  late.fix = FixClass::rtk_fixed;
  late.local_m = {2, 0, 10};
  live.add(late);
  const auto used = live.take_ranges();
  ASSERT_EQ(used.size(), 1U);
  EXPECT_TRUE(used.front().used()) << used.front().refused;
}

}  // namespace
}  // namespace anchord::live_flight_test
