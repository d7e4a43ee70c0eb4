// One flight, its positions spoilt as rovers and links do it: the anchors stay where the clean flight has
// them, in the solve and live.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <random>

#include "core/geo/enu.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/live_flight.hpp"
#include "core/localize/live_track.hpp"
#include "tests/core/localize/flight_support.hpp"
#include "tests/core/localize/spoilt_track.hpp"

namespace anchord::spoilt_track_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

MadeFlight globe() {
  MadeFlight made;
  made.frame = TrackFrame::wgs84;
  return made;
}

class SpoiltTrack : public ::testing::TestWithParam<testing::SpoiltWay> {};

TEST_P(SpoiltTrack, MovesNoAnchorOfTheSolve) {
  const auto flight = make_flight(globe());
  auto bad = flight;
  GetParam().spoil(bad.fixes);
  const auto clean = solve_flight(flight), spoilt = solve_flight(bad);
  ASSERT_TRUE(clean && spoilt);
  EXPECT_FALSE(spoilt.value().fixes_refused.empty());
  for (std::size_t i = 0; i < clean.value().anchors.size(); ++i) {
    const auto& want = clean.value().anchors[i].estimate;
    const auto& got = spoilt.value().anchors[i].estimate;
    ASSERT_TRUE(got.best) << got.reason;
    EXPECT_EQ(got.verdict, Verdict::ok) << got.reason;
    EXPECT_LT(testing::apart_m(*want.best->wgs84, *got.best->wgs84), 0.01);
  }
}

TEST_P(SpoiltTrack, IsCountedTheSameHoweverOftenItIsAsked) {
  auto flight = make_flight(globe());
  GetParam().spoil(flight.fixes);
  for (const std::size_t most : {std::size_t{72'000}, flight.fixes.size() / 3}) {
    LiveTrack asked(TrackFrame::wgs84, {.max_poses = most});
    for (std::size_t i = 0; i < flight.fixes.size(); ++i) {
      asked.add(flight.fixes[i]);
      const auto counted = asked.refused();
      if (i % 97 != 0 && i + 1 < flight.fixes.size()) continue;
      LiveTrack not_asked(TrackFrame::wgs84, {.max_poses = most});
      for (std::size_t k = 0; k <= i; ++k) not_asked.add(flight.fixes[k]);
      EXPECT_EQ(counted, not_asked.refused()) << i;
    }
  }
}

TEST_P(SpoiltTrack, MovesNoAnchorOfTheLiveFlight) {
  const auto flight = make_flight(globe());
  auto bad = flight;
  GetParam().spoil(bad.fixes);
  const auto fly = [](const FlightData& data) {
    LiveFlight live(data.mission);
    testing::play(live, data);
    return live;
  };
  const auto clean = fly(flight), spoilt = fly(bad);
  EXPECT_FALSE(spoilt.fixes_refused().empty());
  EXPECT_LT(testing::apart_m(*clean.origin(), *spoilt.origin()), 50);
  const auto want = clean.estimates(), got = spoilt.estimates();
  ASSERT_EQ(want.size(), got.size());
  for (std::size_t i = 0; i < want.size(); ++i) {
    ASSERT_TRUE(got[i].best) << got[i].reason;
    EXPECT_EQ(got[i].verdict, Verdict::ok) << got[i].reason;
    EXPECT_LT(testing::apart_m(*want[i].best->wgs84, *got[i].best->wgs84), 0.05) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Ways, SpoiltTrack, ::testing::ValuesIn(testing::spoilt_ways()),
                         [](const auto& made) { return made.param.name; });

TEST(SpoiltTrackSolve, RefusesToAcceptWhenAPartOfTheTrackIsOffAsAWhole) {
  auto flight = make_flight(globe());
  for (std::size_t i = flight.fixes.size() * 7 / 10; i < flight.fixes.size(); ++i)
    testing::move(flight.fixes[i], {3, 0, 0});
  const auto solution = solve_flight(flight);
  ASSERT_TRUE(solution);
  EXPECT_NEAR(static_cast<double>(solution.value().fixes_refused.at("position_step")) /
                  static_cast<double>(flight.fixes.size()),
              0.3, 0.01);
  for (const auto& anchor : solution.value().anchors) {
    EXPECT_FALSE(anchor.estimate.acceptable());
    const auto& gates = anchor.estimate.gates;
    EXPECT_TRUE(std::ranges::any_of(gates, [](const Gate& g) { return g.name == "track" && !g.passed; }));
  }
}

TEST(SpoiltTrackLive, GivesUpASitesOriginThatIsElsewhere) {
  const auto flight = make_flight(globe());
  LiveFlight live(flight.mission, {.origin = Wgs84{48, 11, 500}});
  testing::play(live, flight);
  EXPECT_LT(testing::apart_m(*live.origin(), flight.fixes.front().position), 100);
  for (const auto& estimate : live.estimates()) EXPECT_EQ(estimate.verdict, Verdict::ok) << estimate.reason;
}

TEST(SpoiltTrackLive, CountsPositionsOfABaseThatMoved) {
  auto flight = make_flight(globe());
  const std::size_t from = flight.fixes.size() * 6 / 10;
  for (std::size_t i = from; i < flight.fixes.size(); ++i) testing::move(flight.fixes[i], {3, 0, 0});
  LiveFlight live(flight.mission);
  for (std::size_t i = 0; i < from + 20; ++i) live.add(flight.fixes[i]);
  EXPECT_EQ(live.fixes_refused().at("position_step"), 20U);
}

}  // namespace
}  // namespace anchord::spoilt_track_test
