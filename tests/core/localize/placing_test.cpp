// Ranges onto the track: sparse tracks, poses that come with the ranges, heights that are held or known, and
// what is said where nothing can be placed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/geo/tag_track.hpp"
#include "core/localize/flight_copies.hpp"
#include "core/localize/flight_digest.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/fuse.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::placing_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

double worst_m(const FlightSolution& s, const MadeFlight& made) {
  double worst = 0;
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const auto& best = s.anchors[i].estimate.best;
    worst = std::max(worst, best ? (best->position.m - made.anchors[i]).norm() : 1e9);
  }
  return worst;
}

void keep_every(FlightData& flight, std::size_t nth) {
  std::vector<Fix> few;
  for (std::size_t i = 0; i < flight.fixes.size(); i += nth) few.push_back(flight.fixes[i]);
  flight.fixes = std::move(few);
}

TEST(SparseTrack, OfOneHertzGivesAnAnswerInsideItsClaim) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    MadeFlight made;
    made.seed = seed;
    auto flight = make_flight(made);
    keep_every(flight, 10);
    const auto s = solve_flight(flight);
    ASSERT_TRUE(s);
    EXPECT_TRUE(s.value().placed);
    EXPECT_EQ(s.value().refused.count("track_gap"), 0U);
    for (std::size_t i = 0; i < made.anchors.size(); ++i) {
      const auto& e = s.value().anchors[i].estimate;
      ASSERT_TRUE(e.best);
      const Eigen::Vector3d off = e.best->position.m - made.anchors[i];
      EXPECT_LT(off.dot(e.best->covariance_m2.inverse() * off), 11.3) << "99 %, anchor " << i;
      EXPECT_LT(off.norm(), 0.3);
    }
  }
}

TEST(SparseTrack, CountsARangeTheLessTheLongerTheGapItIsIn) {
  std::vector<Fix> fixes;
  for (int i = 0; i < 400; ++i) {
    if (i > 200 && i < 215) continue;  // 1.5 s without a position
    Fix fix;
    fix.time = UtcTime::from_seconds(0.1 * i);
    fix.frame = TrackFrame::local;
    fix.local_m = {10 * std::cos(0.05 * i), 10 * std::sin(0.05 * i), 5};  // 5 m/s round a circle: 2.5 m/s^2
    fix.fix = FixClass::rtk_fixed;
    fixes.push_back(fix);
  }
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  const auto place = [](double t_s) {
    return Eigen::Vector3d(10 * std::cos(0.5 * t_s), 10 * std::sin(0.5 * t_s), 5);
  };
  const double usual_m2 = track.at(10.05).covariance_m2(0, 0);
  const TagPoint midway = track.at(20.75);
  ASSERT_EQ(midway.refused, TrackRefusal::none);
  const double missed_m = (midway.position_m - place(20.75)).norm();
  EXPECT_GT(missed_m, 0.5);
  // Per axis; three of them hold the miss, and neither by a factor of two.
  const double claimed_m = std::sqrt(3 * (midway.covariance_m2(0, 0) - usual_m2));
  EXPECT_GT(claimed_m, 0.5 * missed_m);
  EXPECT_LT(claimed_m, 2.0 * missed_m);
  EXPECT_LT(track.at(20.02).covariance_m2(0, 0), midway.covariance_m2(0, 0));
  const TagTrack walled(fixes, std::nullopt, UtcTime{}, {.max_gap_s = 1.0});
  EXPECT_EQ(walled.at(20.75).refused, TrackRefusal::gap);
}

TEST(SparseTrack, NeedsNoDenserPosesWhereTheyComeWithTheRanges) {
  MadeFlight made;
  auto flight = make_flight(made);
  // One range of each anchor in turn, every 0.9 s, with the pose of its instant.
  std::ranges::sort(flight.ranges, {}, &Range::time);
  std::vector<Range> few;
  flight.fixes.clear();
  double next_s = 0;
  for (const Range& range : flight.ranges) {
    const double t_s = static_cast<double>(range.time.ns) * 1e-9;
    if (t_s < next_s || range.anchor.value != 0x6000 + few.size() % 4) continue;
    next_s = t_s + 0.9;
    few.push_back(range);
    Fix fix;
    fix.time = range.time;
    fix.frame = TrackFrame::local;
    fix.local_m = testing::path(made, t_s);
    fix.fix = FixClass::rtk_fixed;
    flight.fixes.push_back(fix);
  }
  flight.ranges = few;
  const auto s = solve_flight(flight);
  ASSERT_TRUE(s);
  EXPECT_EQ(s.value().refused.count("track_gap"), 0U);
  EXPECT_GT(s.value().n_used, few.size() * 8 / 10);
  EXPECT_LT(worst_m(s.value(), made), 0.5);
}

TEST(Unplaced, IsSaidFirstWithNumbersAndWhatToDo) {
  const MadeFlight made;
  auto flight = make_flight(made);
  const auto first_note = [](const FlightData& f) {
    const auto s = solve_flight(f).value();
    EXPECT_FALSE(s.placed);
    return s.notes.empty() ? std::string() : s.notes.front();
  };
  auto millimetres = flight;
  for (auto& range : millimetres.ranges) range.distance_m *= 1000;
  EXPECT_NE(first_note(millimetres).find("range_m is in metres"), std::string::npos);
  auto late = flight;
  for (auto& range : late.ranges) range.time.ns += 3'600'000'000'000;
  EXPECT_NE(first_note(late).find("both must use one clock"), std::string::npos);
  auto sparse = flight;
  keep_every(sparse, 300);
  // A range right beside one of the few positions has its place; the others do not.
  const auto solved = solve_flight(sparse).value();
  ASSERT_FALSE(solved.notes.empty());
  EXPECT_NE(solved.notes.front().find("track_gap"), std::string::npos) << solved.notes.front();
  auto milliseconds = flight;
  for (auto& range : milliseconds.ranges) range.time.ns *= 1000;
  EXPECT_NE(first_note(milliseconds).find("t_s is in seconds"), std::string::npos);
}

TEST(Heights, InTwoDimensionsHaveNoMirror) {
  MadeFlight made;
  made.height_swing_m = 0;
  for (auto& a : made.anchors) a.z() = 2.5;
  const auto s = solve_flight(make_flight(made), {.dims = Dims::two, .anchor_height_m = 2.5});
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) {
    EXPECT_EQ(anchor.estimate.verdict, Verdict::ok) << anchor.estimate.reason;
    EXPECT_FALSE(anchor.estimate.mirror);
  }
  EXPECT_LT(worst_m(s.value(), made), 0.1);
}

const Gate* held_height(const AnchorSolution& anchor) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, "held_height", &Gate::name);
  return at == gates.end() ? nullptr : &*at;
}

TEST(Heights, NobodyStatedAreNeitherMeasuredNorAcceptable) {
  MadeFlight made;
  for (auto& a : made.anchors) a.z() = 2.5;
  const auto s = solve_flight(make_flight(made), {.dims = Dims::two});
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) {
    EXPECT_EQ(anchor.determined, Determined::horizontal);
    EXPECT_GT(anchor.estimate.v95_m, 5.0) << "a storey of sigma";
    EXPECT_FALSE(anchor.estimate.acceptable());
    ASSERT_TRUE(held_height(anchor));
    EXPECT_FALSE(held_height(anchor)->passed);
    EXPECT_FALSE(held_height(anchor)->value);
  }
}

TEST(Heights, StatedAreAsUncertainAsTheyWereStated) {
  MadeFlight made;
  for (auto& a : made.anchors) a.z() = 2.5;
  const FlightData flight = make_flight(made);
  FlightOptions options{.dims = Dims::two, .anchor_height_m = 2.5};
  options.floor_sigma_m = 0;
  for (const double sigma_m : {0.1, 0.4, 0.8}) {
    options.anchor_height_sigma_m = sigma_m;
    const auto s = solve_flight(flight, options);
    ASSERT_TRUE(s);
    for (const auto& anchor : s.value().anchors) {
      EXPECT_EQ(anchor.determined, Determined::horizontal);
      EXPECT_NEAR(anchor.estimate.v95_m, 1.96 * sigma_m, 1e-3);
      ASSERT_TRUE(held_height(anchor));
      EXPECT_EQ(held_height(anchor)->passed, sigma_m <= 0.5) << held_height(anchor)->why;
    }
  }
}

TEST(Heights, OfOneAnchorThatWasStatedWrongMovesItAsItsCovarianceSays) {
  MadeFlight made;
  made.height_swing_m = 0;
  for (auto& a : made.anchors) a.z() = 2.5;
  FlightOptions options{.dims = Dims::two, .anchor_height_m = 2.5};
  options.floor_sigma_m = 0;
  // What all anchors share is known, and takes no part of it.
  options.fixed_bias_m = made.bias_m;
  options.lever_prior_m = options.curve_prior_m = options.lag_prior_s = 1e-4;
  const auto right = solve_flight(make_flight(made), options);
  made.anchors[0].z() = 2.55;  // little, so that the loss rejects no range for it
  const auto wrong = solve_flight(make_flight(made), options);
  ASSERT_TRUE(right && wrong);
  const Eigen::Matrix3d& c = right.value().anchors[0].estimate.best->covariance_m2;
  const Eigen::Vector2d told_m = -0.05 * c.col(2).head<2>() / c(2, 2);
  const Eigen::Vector2d moved_m = (wrong.value().anchors[0].estimate.best->position.m -
                                   right.value().anchors[0].estimate.best->position.m)
                                      .head<2>();
  EXPECT_GT(moved_m.norm(), 0.004);
  EXPECT_LT((moved_m - told_m).norm(), 0.2 * moved_m.norm()) << told_m << " / " << moved_m;
}

TEST(Heights, StatedGetNoBetterByTheNumberOfFlights) {
  std::vector<Estimate> flights;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    MadeFlight made;
    made.seed = seed;
    for (auto& a : made.anchors) a.z() = 2.5;
    const auto s = solve_flight(make_flight(made), {.dims = Dims::two, .anchor_height_m = 2.5});
    ASSERT_TRUE(s);
    flights.push_back(s.value().anchors[0].estimate);
  }
  const Estimate fused = fuse_estimates(flights);
  EXPECT_GE(fused.v95_m, 1.95 * 0.1);
  EXPECT_LT(fused.h95_m, flights[0].h95_m);
}

TEST(Heights, AreEllipsoidalWhereTheTrackIsGlobal) {
  MadeFlight made;
  made.frame = TrackFrame::wgs84;
  for (auto& a : made.anchors) a.z() = 2.5;
  const FlightData flight = make_flight(made);
  // The origin of the answers is the first fix, which flies some metres above that of the simulation.
  const auto s = solve_flight(flight, {.dims = Dims::two, .anchor_height_m = made.origin.height_m + 2.5});
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) {
    ASSERT_TRUE(anchor.estimate.best);
    EXPECT_NEAR(anchor.estimate.best->wgs84.value().height_m, made.origin.height_m + 2.5, 0.01);
    EXPECT_LT(anchor.residual_scale_m, 0.2);
  }
}

TEST(Heights, GivenByAPriorDecideTheSideOfAFlightAtOneHeight) {
  MadeFlight made;
  made.height_swing_m = 0;
  made.frame = TrackFrame::wgs84;
  for (auto& a : made.anchors) a.z() = 2.0;
  FlightOptions options;
  options.height_prior = {made.origin.height_m + 1.7, 0.5};
  options.origin = made.origin;
  const auto s = solve_flight(make_flight(made), options);
  ASSERT_TRUE(s);
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const auto& e = s.value().anchors[i].estimate;
    EXPECT_EQ(e.verdict, Verdict::ok) << e.reason;
    EXPECT_FALSE(e.mirror);
    EXPECT_NEAR(e.best->position.m.z(), 2.0, 0.5);
  }
}

TEST(Heights, AskedForInTheWrongDimensionsAreAnError) {
  const auto flight = make_flight(MadeFlight{});
  EXPECT_EQ(solve_flight(flight, {.anchor_height_m = 2.0}).error().code, Errc::invalid_argument);
  FlightOptions flat{.dims = Dims::two};
  flat.height_prior = {2.0, 1.0};
  EXPECT_EQ(solve_flight(flight, flat).error().code, Errc::invalid_argument);
  EXPECT_EQ(solve_flight(flight, {.fixed_bias_m = 1e9}).error().code, Errc::invalid_argument);
}

TEST(KitProfile, CountsAFlightGivenTwiceOnceAndKeepsANamesake) {
  MadeFlight made;
  made.bias_m = 0.3;
  const FlightData one = make_flight(made);
  FlightData again = one;
  again.mission.name = "copy";
  made.seed = 2;
  FlightData namesake = make_flight(made);
  namesake.mission.name = one.mission.name;
  EXPECT_EQ(flight_digest(one), flight_digest(again));
  EXPECT_NE(flight_digest(one), flight_digest(namesake));

  const FlightData* twice[] = {&one, &again};
  KitProfile profile;
  const auto both = solve_flights(twice, {}, &profile).value();
  EXPECT_EQ(profile.factors.size(), 1U);
  const auto alone = solve_flight(one).value();
  EXPECT_NEAR(both[0].shared.bias_m.sigma, alone.shared.bias_m.sigma, 1e-6);
  const auto& notes = both[1].notes;
  EXPECT_TRUE(std::ranges::any_of(
      notes, [](const std::string& n) { return n.find("counts once") != std::string::npos; }));
  // A profile's factor of another flight in a folder of the same name is evidence like any other.
  const auto helped = solve_flight(namesake, {.profile = profile}).value();
  EXPECT_LT(helped.shared.bias_m.sigma, solve_flight(namesake).value().shared.bias_m.sigma);
  profile.kit = "another";
  const auto other = solve_flight(namesake, {.profile = profile}).value();
  EXPECT_TRUE(std::ranges::any_of(
      other.notes, [](const std::string& n) { return n.find("of kit 'another'") != std::string::npos; }));
}

TEST(FlightCopies, AreFlightsWithMostOfTheSameRangesWhateverTheirTrackAndTheLargestOneCounts) {
  MadeFlight made;
  const FlightData whole = make_flight(made);
  FlightData part = whole, half = whole, track = whole;
  part.ranges.resize(whole.ranges.size() * 3 / 5);
  std::ranges::reverse(part.ranges);
  for (auto& fix : track.fixes) fix.position.height_m += 0.2;
  for (std::size_t i = half.ranges.size() / 3; i < half.ranges.size(); ++i)
    half.ranges[i].distance_m += 0.004;
  FlightData later = whole;
  for (auto& range : later.ranges) range.time.ns += 86'400'123'456'789'000;
  for (auto& fix : later.fixes) fix.time.ns += 86'400'123'456'789'000;
  EXPECT_EQ(flight_digest(later), flight_digest(whole)) << "played again";
  EXPECT_NE(dated_flight_digest(later), dated_flight_digest(whole));
  FlightData corrected = whole;
  for (auto& range : corrected.ranges) {
    corrected.received_m.push_back(range.distance_m);
    range.distance_m -= 0.1;
  }
  made.seed = 2;
  const FlightData other = make_flight(made);
  using Copies = std::vector<std::optional<std::size_t>>;
  const auto of = [](std::vector<const FlightData*> flights) { return flight_copies(flights); };
  EXPECT_EQ(of({&part, &whole, &other}), (Copies{1, std::nullopt, std::nullopt}));
  EXPECT_EQ(of({&whole, &track, &corrected, &later}), (Copies{std::nullopt, 0, 0, 0}));
  EXPECT_EQ(of({&whole, &half}), (Copies{std::nullopt, std::nullopt})) << "most of them are its own";
  // A tag that stands still, and distances to the centimetre: other flights there are no copies.
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(4.0, 0.02);
  std::vector<FlightData> still(4);
  for (auto& flight : still)
    for (int i = 0; i < 3000; ++i) {
      Range range;
      range.anchor = NetworkId{0x6a30};
      range.time.ns = std::int64_t{i} * 100'000'000;
      range.distance_m = std::round(noise(random) * 100) / 100;
      flight.ranges.push_back(range);
    }
  EXPECT_EQ(of({still.data(), &still[1], &still[2], &still[3]}), Copies(4));
}

}  // namespace
}  // namespace anchord::placing_test
