// The whole mission flown with everything off at once: GNSS offset, a barometer that drifts,
// wind, a slow and lossy link. ANCHORD_SEEDS=20 for the whole table; one seed of each dialect keeps the test
// short. ANCHORD_SEED=N flies seed N alone and says what happens.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "core/planning/local_plan.hpp"
#include "server/flight/closed_loop.hpp"

namespace anchord::flight::piloted_loop_test {
namespace {

ClosedLoopOptions hostile(std::uint64_t seed) {
  ClosedLoopOptions o;
  o.seed = seed;
  o.radio.turn_lobe_db = 6;
  o.radio.height_lobe = true;
  o.vehicle.wind_mps = {8, 0, 0};
  o.vehicle.wind_push = 0.04;  // what a good position control leaves of it
  auto& a = o.autopilot;
  a.dialect = seed % 2 == 1 ? drone::Autopilot::ardupilot : drone::Autopilot::px4;
  const double turn = static_cast<double>(seed);
  a.gnss_offset_m = {1.5 * std::cos(turn), 1.5 * std::sin(turn), 1};
  a.baro_drift_mps = seed % 4 < 2 ? 0.02 : -0.02;
  a.latency_s = 0.25;
  a.loss = a.loss_in = 0.3;
  a.seed = seed;
  return o;
}

TEST(PilotedLoop, LandsAtHomeClearOfTheBuildingAndFindsTheAnchorsWithEverythingOff) {
  const auto world = sim::demonstration_world();
  const auto plan = plan_from_outline(world);
  ASSERT_TRUE(plan);
  const char* text = std::getenv("ANCHORD_SEEDS");
  const char* one = std::getenv("ANCHORD_SEED");
  const std::uint64_t first = one != nullptr ? std::strtoull(one, nullptr, 10) : 1;
  const std::uint64_t n = one != nullptr ? first : text != nullptr ? std::strtoull(text, nullptr, 10) : 2;
  std::printf("seed  flight_s  clearance_m  lowest_m  home_m  ok  median_m  worst_m\n");
  for (std::uint64_t seed = first; seed <= n; ++seed) {
    const auto flown = fly_closed_loop(world, plan.value(), hostile(seed));
    ASSERT_TRUE(flown) << flown.error().message;
    const auto& r = flown.value();
    const auto forecast = planning::check_plan(plan.value()).value().time;
    EXPECT_GE(r.flight_s, forecast.low_s) << "seed " << seed;
    EXPECT_LE(r.flight_s, forecast.high_s) << "seed " << seed;
    if (one != nullptr)
      for (const auto& [time_s, line] : r.log)
        std::printf("%8.1f  %-28s %s\n", time_s, line.code.c_str(), line.text.c_str());
    FlightOptions solve;
    solve.origin = world.origin;
    solve.priors = r.priors;
    const auto solution = solve_flight(r.data, solve);
    ASSERT_TRUE(solution) << "seed " << seed << ": " << r.state.reason;
    const auto judged = assess(world, solution.value());
    double worst_m = 0;
    int ok = 0;
    for (const auto& j : judged) {
      worst_m = std::max(worst_m, j.error_m);
      ok += j.verdict == Verdict::ok;
    }
    std::printf("%4llu  %8.0f  %11.2f  %8.2f  %6.2f  %2d  %8.3f  %7.3f\n",
                static_cast<unsigned long long>(seed), r.flight_s, r.clearance_m, r.lowest_m, r.home_m, ok,
                median_error_m(judged), worst_m);
    std::fflush(stdout);
    EXPECT_TRUE(r.landed) << "seed " << seed << ": " << r.state.reason;
    EXPECT_LT(r.home_m, 3) << "seed " << seed;
    EXPECT_GE(r.clearance_m, 3) << "seed " << seed;
    EXPECT_GE(r.lowest_m, plan.value().settings.min_height_m) << "seed " << seed;
    EXPECT_EQ(ok, 6) << "seed " << seed;
    EXPECT_LT(median_error_m(judged), 0.1) << "seed " << seed;
  }
}

}  // namespace
}  // namespace anchord::flight::piloted_loop_test
