// A whole mission closed over the simulators: planned from the outline, flown, solved and judged against the
// truth.
#include "server/flight/closed_loop.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <limits>

#include "core/geo/enu.hpp"
#include "core/planning/local_plan.hpp"

namespace anchord::flight::closed_loop_test {
namespace {

struct Row {
  std::uint64_t seed{};
  double flight_s{}, wall_s{}, median_m{}, worst_m{};
  double low_s{}, expected_s{}, high_s{};  ///< the forecast of the plan
  double ring_m{};                         ///< the rival: one ring at 4 m, as a pilot flies it by hand
  double rings_m{};                        ///< for comparison: laps at 3 and at 9 m, which see the heights
  int ok{}, inside{};
};

ClosedLoopOptions seeded(std::uint64_t seed) {
  ClosedLoopOptions options;
  options.seed = seed;
  options.radio.turn_lobe_db = 6;
  options.radio.height_lobe = true;
  return options;
}

Row fly(const sim::World& world, std::uint64_t seed) {
  Row row;
  row.seed = seed;
  const auto options = seeded(seed);
  const auto plan = plan_from_outline(world);
  EXPECT_TRUE(plan.has_value());
  const auto flown = fly_closed_loop(world, plan.value(), options);
  EXPECT_TRUE(flown.has_value()) << flown.error().message;
  const auto& result = flown.value();
  EXPECT_EQ(procedure::to_string(result.state.step), "done") << result.state.reason;
  row.flight_s = result.flight_s;
  const auto forecast = planning::check_plan(plan.value()).value().time;
  row.low_s = forecast.low_s, row.expected_s = forecast.expected_s, row.high_s = forecast.high_s;
  EXPECT_GE(result.flight_s, forecast.low_s) << "seed " << seed;
  EXPECT_LE(result.flight_s, forecast.high_s) << "seed " << seed;
  row.wall_s = result.wall_s;
  FlightOptions solve;
  solve.origin = world.origin;
  solve.priors = result.priors;
  const auto solution = solve_flight(result.data, solve);
  EXPECT_TRUE(solution.has_value());
  const auto judged = assess(world, solution.value());
  row.median_m = median_error_m(judged);
  for (const auto& j : judged) {
    row.worst_m = std::max(row.worst_m, j.error_m);
    row.ok += j.verdict == Verdict::ok;
    row.inside += j.inside;
  }
  const auto rival = [&](const std::vector<double>& heights_m) {
    const auto solved = solve_flight(fly_ring(world, result.flight_s, heights_m, options), solve);
    return solved ? median_error_m(assess(world, solved.value())) : std::numeric_limits<double>::infinity();
  };
  row.ring_m = rival({4});
  row.rings_m = rival({3, 9});
  return row;
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return (values[(values.size() - 1) / 2] + values[values.size() / 2]) / 2;
}

struct Table {
  double median_m{}, worst_m{}, ring_m{}, rings_m{};
  int anchors{}, ok{}, inside{};
};
Table fly_seeds(const char* name, const sim::World& world, std::uint64_t n) {
  std::printf(
      "%s\nseed  flight_s  forecast        times_real  ok  inside95  median_m  worst_m  ring_4m  "
      "rings_3_9m\n",
      name);
  std::vector<double> medians, rings, two_rings;
  Table out;
  for (std::uint64_t seed = 1; seed <= n; ++seed) {
    const auto r = fly(world, seed);
    std::printf("%4llu  %8.0f  %4.0f %4.0f %4.0f  %10.0f  %2d  %8d  %8.3f  %7.3f  %7.3f  %10.3f\n",
                static_cast<unsigned long long>(seed), r.flight_s, r.low_s, r.expected_s, r.high_s,
                r.flight_s / r.wall_s, r.ok, r.inside, r.median_m, r.worst_m, r.ring_m, r.rings_m);
    std::fflush(stdout);
    medians.push_back(r.median_m);
    rings.push_back(r.ring_m);
    two_rings.push_back(r.rings_m);
    out.anchors += 6;
    out.ok += r.ok;
    out.inside += r.inside;
    out.worst_m = std::max(out.worst_m, r.worst_m);
  }
  out.median_m = median_of(medians);
  out.ring_m = median_of(rings);
  out.rings_m = median_of(two_rings);
  std::printf("all: %d of %d ok, %d inside, median %.4f m, worst %.3f m, ring %.3f m, two rings %.3f m\n",
              out.ok, out.anchors, out.inside, out.median_m, out.worst_m, out.ring_m, out.rings_m);
  return out;
}

// The whole table: ANCHORD_SEEDS=20. One seed keeps the test short.
std::uint64_t seeds() {
  const char* text = std::getenv("ANCHORD_SEEDS");
  return text != nullptr ? std::strtoull(text, nullptr, 10) : 1;
}

/// What every flight must hold, and what twenty must: one flight is a throw of the dice, and over twenty the
/// plan also beats rings whose heights a person chose well.
void expect_found(const Table& table, double one_median_m, double all_median_m) {
  EXPECT_EQ(table.ok, table.anchors);
  EXPECT_EQ(table.inside, table.anchors);
  EXPECT_LT(table.worst_m, 0.2);
  EXPECT_LT(table.median_m, one_median_m);
  EXPECT_LT(table.median_m, table.ring_m);
  if (seeds() < 20) return;
  EXPECT_LT(table.median_m, all_median_m);
  EXPECT_LT(table.median_m, table.rings_m);
}

TEST(ClosedLoop, FindsEveryAnchorThroughWindowsFromTheOutlineAlone) {
  expect_found(fly_seeds("windows", sim::demonstration_world(), seeds()), 0.05, 0.04);
}

TEST(ClosedLoop, FindsEveryAnchorThroughWallsFromTheOutlineAlone) {
  expect_found(fly_seeds("walls", walled_world(), seeds()), 0.06, 0.05);
}

/// Only the south front may be flown along, in one upright plane, as in a street: what is inside and its
/// mirror in the houses opposite fit alike.
Plan street_plan(const sim::World& world) {
  auto plan = plan_from_outline(world).value();
  const EnuFrame frame(world.origin);
  const auto at = [&](double x, double y) {
    const auto p = frame.wgs84_from_enu(Enu{{x, y, 0}});
    return LonLat{p.lon_deg, p.lat_deg};
  };
  plan.fence = {at(-11, -10), at(41, -10), at(41, -8), at(-11, -8)};
  plan.waypoints.clear();
  for (const double x : {-4.0, 4.0, 12.0, 20.0, 28.0, 35.0}) {
    PlanWaypoint w;
    w.at = at(x, -9);
    w.height_m = plan.waypoints.size() % 2 == 0 ? 2.5 : 7.5;
    w.turn = true;
    w.height_search = true;
    plan.waypoints.push_back(w);
  }
  return plan;
}

TEST(ClosedLoop, AFlightAlongOneFrontKnowsTheSideFromItsTurn) {
  const auto world = sim::demonstration_world();
  const auto plan = street_plan(world);
  const auto flown = fly_closed_loop(world, plan, seeded(3));
  ASSERT_TRUE(flown.has_value()) << flown.error().message;
  const auto& result = flown.value();
  EXPECT_EQ(procedure::to_string(result.state.step), "done") << result.state.reason;
  EXPECT_GE(result.priors.size(), 4u);
  FlightOptions options;
  options.origin = world.origin;
  const auto blind = solve_flight(result.data, options);
  options.priors = result.priors;
  const auto told = solve_flight(result.data, options);
  ASSERT_TRUE(blind && told);
  // In doubt, or on the wrong side without a doubt.
  const auto open = [](const Estimate& e) {
    return !e.best || e.best->position.m.y() < 0 || (e.mirror && e.mirror->position.m.y() < 0);
  };
  int n_blind = 0, n_told = 0, n_live = 0;
  for (const auto& a : blind.value().anchors) n_blind += open(a.estimate);
  for (const auto& a : told.value().anchors) {
    n_told += open(a.estimate);
    ASSERT_TRUE(a.estimate.best);
    if (result.priors.contains(a.estimate.anchor)) {
      EXPECT_GT(a.estimate.best->position.m.y(), 0) << to_string(a.estimate.anchor);
    } else {
      EXPECT_NE(a.estimate.verdict, Verdict::ok) << "too far for its lobes: nobody claims a side";
    }
  }
  for (const auto& e : result.live) {
    n_live += open(e);
    ASSERT_TRUE(e.best);
    if (result.priors.contains(e.anchor)) {
      EXPECT_GT(e.best->position.m.y(), 0) << to_string(e.anchor) << " in the air";
    }
  }
  std::printf("one front: side open for %d of 6 anchors without the turn, %d with it, %d in the air\n",
              n_blind, n_told, n_live);
  EXPECT_GE(n_blind, 4) << "without the turn the street leaves both sides open";
  EXPECT_LE(n_told, 2) << "where the lobes were not clear both stay";
  EXPECT_LE(n_live, 2);
}

}  // namespace
}  // namespace anchord::flight::closed_loop_test
