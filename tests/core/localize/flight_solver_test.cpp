#include "core/localize/flight_solver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "tests/core/localize/flight_support.hpp"

namespace anchord::flight_solver_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

double error_m(const FlightSolution& s, const MadeFlight& m, std::size_t i) {
  return (s.anchors[i].estimate.best.value().position.m - m.anchors[i]).norm();
}

TEST(FlightSolver, FindsEveryAnchorOfAnOrdinaryFlight) {
  const MadeFlight made;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s) << s.error().message;
  ASSERT_EQ(s.value().anchors.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& e = s.value().anchors[i].estimate;
    EXPECT_EQ(e.verdict, Verdict::ok) << e.reason;
    EXPECT_FALSE(e.mirror);
    EXPECT_LT(error_m(s.value(), made, i), 0.05);
    EXPECT_GT(e.h95_m, 0.0);
    EXPECT_GT(e.gdop.value(), 0.0);
  }
  EXPECT_TRUE(s.value().shared.bias_determined);
}

TEST(FlightSolver, AsksNothingOfARangeThatItsRowDoesNotHold) {
  MadeFlight made;
  made.nlos_share = 0.2;
  FlightData flight = make_flight(made);
  for (std::size_t i = 0; i < flight.ranges.size(); ++i) flight.ranges[i].seq = i;
  flight.ranges.push_back(flight.ranges.front());  // a repeat
  Range pair = flight.ranges.front();
  pair.kind = RangeKind::anchor_anchor;
  std::tie(pair.tag, pair.anchor) = std::pair(NetworkId{0x6000}, NetworkId{0x6001});
  pair.distance_m = (made.anchors[0] - made.anchors[1]).norm();
  flight.ranges.push_back(pair);
  for (const bool with_models : {false, true}) {
    if (with_models) {
      flight.error_models.resize(flight.ranges.size());
      for (std::size_t i = 0; i < flight.ranges.size(); i += 2) flight.error_models[i] = RangeErrorModel{0.9};
    }
    FlightData rows = flight;
    rows.keep_rows();
    EXPECT_TRUE(rows.ranges.empty());
    const auto whole = solve_flight(flight), kept = solve_flight(rows);
    ASSERT_TRUE(whole && kept);
    EXPECT_EQ(kept.value().n_ranges, whole.value().n_ranges);
    EXPECT_EQ(kept.value().refused, whole.value().refused);
    EXPECT_EQ(kept.value().notes, whole.value().notes);
    EXPECT_EQ(whole.value().refused.at("duplicate"), 1U);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto &a = whole.value().anchors[i], &b = kept.value().anchors[i];
      EXPECT_EQ(b.estimate.best.value().position.m, a.estimate.best.value().position.m);
      EXPECT_EQ(b.estimate.best->covariance_m2, a.estimate.best->covariance_m2);
      EXPECT_EQ(b.residuals.size(), a.residuals.size());
    }
  }
}

TEST(FlightSolver, AnswersOnTheGlobeForAnRtkTrack) {
  MadeFlight made;
  made.frame = TrackFrame::wgs84;
  const auto s = solve_flight(make_flight(made), {.origin = made.origin});
  ASSERT_TRUE(s);
  ASSERT_TRUE(s.value().origin);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LT(error_m(s.value(), made, i), 0.05);
    // 1e-5 degrees are 1.1 m: the answer is near the site, in degrees.
    EXPECT_NEAR(s.value().anchors[i].estimate.best->wgs84.value().lat_deg, made.origin.lat_deg, 2e-4);
  }
}

TEST(FlightSolver, FindsLagAndBiasTogetherWithinThreeSigmas) {
  MadeFlight made;
  made.lag_s = -0.18;
  made.bias_m = 0.45;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  const auto& shared = s.value().shared;
  EXPECT_NEAR(shared.lag_s.value, -0.18, 3 * shared.lag_s.sigma);
  EXPECT_NEAR(shared.bias_m.value, 0.45, 3 * shared.bias_m.sigma);
  EXPECT_LT(shared.lag_s.sigma, 0.05);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT(error_m(s.value(), made, i), 0.08);
}

TEST(FlightSolver, StaysInsideItsClaimWithFortyPercentNlos) {
  int inside = 0;
  int all = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    MadeFlight made;
    made.nlos_share = 0.4;
    made.seed = seed;
    const auto s = solve_flight(make_flight(made));
    ASSERT_TRUE(s);
    for (std::size_t i = 0; i < 4; ++i, ++all) {
      const auto& e = s.value().anchors[i].estimate;
      ASSERT_TRUE(e.best);
      const Eigen::Vector3d off = e.best->position.m - made.anchors[i];
      if (off.head<2>().norm() <= e.h95_m && std::abs(off.z()) <= e.v95_m) ++inside;
    }
  }
  EXPECT_GE(inside, all * 93 / 100);
}

TEST(FlightSolver, ReportsTheMirrorOfAFlightAtOneHeight) {
  MadeFlight made;
  made.height_swing_m = 0;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto& a = s.value().anchors[i];
    EXPECT_EQ(a.estimate.verdict, Verdict::ambiguous);
    EXPECT_EQ(a.determined, Determined::horizontal);
    EXPECT_LT((a.estimate.best->position.m - made.anchors[i]).head<2>().norm(), 0.1);
    if (std::abs(made.anchors[i].z() - 6) < 0.5) continue;  // in the plane itself
    ASSERT_TRUE(a.estimate.mirror) << i;
    // The path is at 6 m: truth z and 12 - z fit alike, one is given as best and the other as mirror.
    const double z = made.anchors[i].z();
    const double best = a.estimate.best->position.m.z();
    const double mirror = a.estimate.mirror->position.m.z();
    EXPECT_NEAR(std::min(best, mirror), std::min(z, 12 - z), 0.3);
    EXPECT_NEAR(std::max(best, mirror), std::max(z, 12 - z), 0.3);
  }
}

TEST(FlightSolver, DoesNotAnswerALineFlightWithConfidence) {
  MadeFlight made;
  made.height_swing_m = 0.05;
  made.width_m = 0.1;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (const auto& a : s.value().anchors) {
    EXPECT_EQ(a.estimate.verdict, Verdict::weak_geometry);
    EXPECT_EQ(a.determined, Determined::none);
    EXPECT_NE(a.estimate.reason.find("line"), std::string::npos) << a.estimate.reason;
  }
}

TEST(FlightSolver, RefusesAndCountsBadRows) {
  const MadeFlight made;
  auto flight = make_flight(made);
  auto bad = [&](double distance_m, double t_s) {
    Range range = flight.ranges.front();
    range.time = UtcTime::from_seconds(t_s);
    range.distance_m = distance_m;
    flight.ranges.push_back(range);
  };
  bad(0, 10.001);
  bad(std::nan(""), 10.002);
  bad(1e6, 10.003);
  bad(-3, 10.004);
  bad(5, -100);
  flight.ranges.push_back(flight.ranges.front());
  Range stranger = flight.ranges.front();
  stranger.tag = NetworkId{0xbeef};
  flight.ranges.push_back(stranger);
  std::ranges::reverse(flight.ranges);  // out of order on top of it
  const auto s = solve_flight(flight);
  ASSERT_TRUE(s);
  const auto& refused = s.value().anchors[0].estimate.refused;
  EXPECT_EQ(refused.at("zero_range"), 1U);
  EXPECT_EQ(refused.at("not_finite"), 1U);
  EXPECT_EQ(refused.at("out_of_bounds"), 2U);
  EXPECT_EQ(refused.at("outside_track"), 1U);
  EXPECT_EQ(refused.at("duplicate"), 1U);
  EXPECT_EQ(refused.at("unknown_tag"), 1U);
  EXPECT_LT(error_m(s.value(), made, 0), 0.05);
}

TEST(FlightSolver, SaysTooFewForAnAnchorHeardThreeTimes) {
  const MadeFlight made;
  auto flight = make_flight(made);
  std::size_t seen = 0;
  std::erase_if(flight.ranges, [&](const Range& r) { return r.anchor.value == 0x6003 && ++seen > 3; });
  const auto s = solve_flight(flight);
  ASSERT_TRUE(s);
  EXPECT_EQ(s.value().anchors[3].estimate.verdict, Verdict::too_few);
  EXPECT_FALSE(s.value().anchors[3].estimate.best);
  EXPECT_EQ(s.value().anchors[0].estimate.verdict, Verdict::ok);
}

TEST(FlightSolver, IsAnErrorWithoutTrackOrRanges) {
  auto flight = make_flight(MadeFlight{});
  auto no_track = flight;
  no_track.fixes.clear();
  EXPECT_EQ(solve_flight(no_track).error().code, Errc::too_few_observations);
  auto no_ranges = flight;
  no_ranges.ranges.clear();
  EXPECT_EQ(solve_flight(no_ranges).error().code, Errc::too_few_observations);
}

TEST(FlightSolver, SurvivesFloatFixesOnly) {
  auto flight = make_flight(MadeFlight{});
  for (auto& fix : flight.fixes) fix.fix = FixClass::rtk_float;
  const auto s = solve_flight(flight);
  ASSERT_TRUE(s);
  EXPECT_EQ(s.value().anchors[0].estimate.verdict, Verdict::too_few);
  EXPECT_GT(s.value().refused.at("fix_not_good_enough"), 100U);
}

TEST(FlightSolver, EveryMethodEndsAtTheSamePlace) {
  MadeFlight made;
  made.bias_m = 0.3;
  const auto flight = make_flight(made);
  const auto reference = solve_flight(flight);
  ASSERT_TRUE(reference);
  for (const Method method : {Method::levenberg_marquardt, Method::dogleg}) {
    const auto other = solve_flight(flight, {.method = method});
    ASSERT_TRUE(other);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_LT((other.value().anchors[i].estimate.best->position.m -
                 reference.value().anchors[i].estimate.best->position.m)
                    .norm(),
                1e-3);
    }
  }
}

TEST(FlightSolver, AnotherFlightOfTheKitTellsTheBiasTheFirstCannot) {
  MadeFlight strong;
  strong.bias_m = 0.6;
  strong.seed = 2;
  MadeFlight weak = strong;  // far anchors seen from a short path: bias and distance are one
  weak.seed = 3;
  weak.duration_s = 25;
  weak.noise_m = 0.15;
  weak.anchors = {{60, 5, 2}, {-55, 10, 3}};
  const FlightData first = make_flight(strong);
  const FlightData second = make_flight(weak);
  const FlightData* both[] = {&first, &second};
  KitProfile profile;
  const auto s = solve_flights(both, {}, &profile);
  ASSERT_TRUE(s);
  EXPECT_EQ(profile.factors.size(), 2U);
  EXPECT_NEAR(s.value()[1].shared.bias_m.value, 0.6, 0.1);
  // The stored profile does the same for the next flight.
  const auto alone = solve_flight(second, {.profile = profile});
  ASSERT_TRUE(alone);
  EXPECT_NEAR(alone.value().shared.bias_m.value, 0.6, 0.1);
}

TEST(FlightSolver, StopsWhenCanceled) {
  EXPECT_EQ(solve_flight(make_flight(MadeFlight{}), {.canceled = [] { return true; }}).error().code,
            Errc::canceled);
}

TEST(FlightSolver, HoldsTheHeightInTwoDimensions) {
  MadeFlight made;
  for (auto& a : made.anchors) a.z() = 2.5;
  const auto s = solve_flight(make_flight(made), {.dims = Dims::two, .anchor_height_m = 2.5});
  ASSERT_TRUE(s);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_LT(error_m(s.value(), made, i), 0.05);
}

}  // namespace
}  // namespace anchord::flight_solver_test
