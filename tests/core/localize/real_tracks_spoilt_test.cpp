// Real flights (../shared/data), their positions spoilt as rovers and links do it: the anchors stay where the
// clean flight has them, in the solve and live.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "core/localize/flight_solver.hpp"
#include "core/localize/live_flight.hpp"
#include "tests/core/localize/real_flights.hpp"
#include "tests/core/localize/spoilt_track.hpp"
#include "tests/paths.hpp"

namespace anchord {
namespace {

struct RealFlight {
  const char* set;
  const char* flight;
};

double apart_m(const Hypothesis& a, const Hypothesis& b) {
  return a.wgs84 && b.wgs84 ? testing::apart_m(*a.wgs84, *b.wgs84) : (a.position.m - b.position.m).norm();
}

/// Largest difference of an anchor that both answers place; -1 where one of them places none.
template <class Estimates>
double moved_m(const Estimates& clean, const Estimates& spoilt) {
  double most = clean.size() == spoilt.size() ? 0 : -1;
  for (std::size_t i = 0; i < clean.size() && most >= 0; ++i) {
    if (!clean[i].best) continue;
    if (!spoilt[i].best) return -1;
    most = std::max(most, apart_m(*clean[i].best, *spoilt[i].best));
  }
  return most;
}

std::vector<Estimate> solved(const FlightData& flight) {
  std::vector<Estimate> out;
  const auto solution = solve_flight(flight);
  if (!solution) return out;
  for (const auto& anchor : solution.value().anchors) out.push_back(anchor.estimate);
  return out;
}

std::vector<Estimate> followed(const FlightData& flight) {
  LiveFlight live(flight.mission);
  testing::play(live, flight);
  return live.estimates();
}

class RealTracks : public ::testing::TestWithParam<RealFlight> {};

TEST_P(RealTracks, GiveTheSameAnchorsHoweverTheyAreSpoilt) {
  if (!std::filesystem::exists(ANCHORD_SHARED_DATA)) {
    std::printf("SKIPPED: no real flights, looked for %s\n", ANCHORD_SHARED_DATA);
    GTEST_SKIP() << "no real flights, looked for " << ANCHORD_SHARED_DATA;
  }
  const auto set = testing::read_set(GetParam().set);
  const auto found = std::ranges::find_if(
      set.flights, [](const FlightData& f) { return f.mission.name == GetParam().flight; });
  ASSERT_NE(found, set.flights.end());
  const FlightData& flight = *found;
  const auto clean = solved(flight), clean_live = followed(flight);
  ASSERT_FALSE(clean.empty());
  for (const auto& way : testing::spoilt_ways()) {
    FlightData bad = flight;
    way.spoil(bad.fixes);
    const double solve_m = moved_m(clean, solved(bad)), live_m = moved_m(clean_live, followed(bad));
    std::printf("%-10s %-26s solve %7.4f m   live %7.4f m\n", GetParam().flight, way.name.c_str(), solve_m,
                live_m);
    EXPECT_GE(solve_m, 0) << way.name << ": an anchor is lost";
    EXPECT_GE(live_m, 0) << way.name << ": an anchor is lost, live";
    EXPECT_LT(solve_m, 0.05) << way.name;
    EXPECT_LT(live_m, 0.15) << way.name;
  }
}

INSTANTIATE_TEST_SUITE_P(OfEachSet, RealTracks,
                         ::testing::Values(RealFlight{"outdoor-rtk", "los_A_case1"},
                                           RealFlight{"rcv-drone", "seq3"},
                                           RealFlight{"viral-drone", "nya_01"}),
                         [](const auto& made) { return std::string(made.param.flight); });

}  // namespace
}  // namespace anchord
