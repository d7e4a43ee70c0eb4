// Real flights (../shared/data), their positions spoilt as rovers and links do it: the anchors stay where the
// clean flight has them, in the solve and live.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/localize/flight_solver.hpp"
#include "core/localize/live_flight.hpp"
#include "tests/core/localize/real_flights.hpp"
#include "tests/core/localize/spoilt_track.hpp"
#include "tests/paths.hpp"

namespace anchord::real_tracks_spoilt_test {
namespace {

struct RealFlight {
  const char* set;
  const char* flight;
  bool some{false};       ///< a long flight: two ways to spoil it are enough
  bool determined{true};  ///< false: alone it does not tell its bias, and moves within what it claims
};

double apart_m(const Hypothesis& a, const Hypothesis& b) {
  return a.wgs84 && b.wgs84 ? testing::apart_m(*a.wgs84, *b.wgs84) : (a.position.m - b.position.m).norm();
}

struct Moved {
  double most_m{};      ///< of an anchor that both answers place; -1 where one of them places none
  double over_limit{};  ///< the most of difference over what was allowed
};

/// What a flight does not determine may move with any part of its data: allowed is `limit_m`, or the share of
/// one claimed sigma (1-sigma, 3-D) where that is more.
Moved moved(const std::vector<Estimate>& clean, const std::vector<Estimate>& spoilt, double limit_m,
            double share) {
  Moved out;
  if (clean.size() != spoilt.size()) return {-1, 0};
  for (std::size_t i = 0; i < clean.size(); ++i) {
    if (!clean[i].best) continue;
    if (!spoilt[i].best) return {-1, 0};
    const double off_m = apart_m(*clean[i].best, *spoilt[i].best);
    const double claimed_m = std::sqrt(clean[i].best->covariance_m2.trace());
    out.most_m = std::max(out.most_m, off_m);
    out.over_limit = std::max(out.over_limit, off_m / std::max(limit_m, share * claimed_m));
  }
  return out;
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
    if (GetParam().some && way.name != "first_fix_33_km" && way.name != "five_percent_jumps") continue;
    FlightData bad = flight;
    way.spoil(bad.fixes);
    const Moved solve = moved(clean, solved(bad), 0.05, 0.5),
                live = moved(clean_live, followed(bad), 0.15, 1.0);
    std::printf("%-10s %-26s solve %7.4f m (%4.2f of what is allowed)   live %7.4f m (%4.2f)\n",
                GetParam().flight, way.name.c_str(), solve.most_m, solve.over_limit, live.most_m,
                live.over_limit);
    EXPECT_GE(solve.most_m, 0) << way.name << ": an anchor is lost";
    EXPECT_GE(live.most_m, 0) << way.name << ": an anchor is lost, live";
    EXPECT_LT(GetParam().determined ? solve.most_m / 0.05 : solve.over_limit, 1) << way.name;
    EXPECT_LT(GetParam().determined ? live.most_m / 0.15 : live.over_limit, 1) << way.name;
  }
}

INSTANTIATE_TEST_SUITE_P(OfEachSet, RealTracks,
                         ::testing::Values(RealFlight{"outdoor-rtk", "los_A_case1", true},
                                           RealFlight{"rcv-drone", "seq3"},
                                           RealFlight{"viral-drone", "nya_01", true, false}),
                         [](const auto& made) { return std::string(made.param.flight); });

}  // namespace
}  // namespace anchord::real_tracks_spoilt_test
