#include "core/localize/gates.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/localize/fuse.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::gates_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

const Gate& gate(const Estimate& estimate, std::string_view name) {
  const auto at = std::ranges::find(estimate.gates, name, &Gate::name);
  EXPECT_NE(at, estimate.gates.end()) << name;
  return at != estimate.gates.end() ? *at : estimate.gates.front();
}

TEST(Gates, LetAnOrdinaryFlightPass) {
  MadeFlight made;
  made.turn_rate_radps = 0.2;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) {
    for (const Gate& g : anchor.estimate.gates) EXPECT_TRUE(g.passed) << g.name << ": " << g.why;
    EXPECT_TRUE(anchor.estimate.acceptable());
    for (const char* name : {"redundancy", "rejected", "geometry", "precision", "side", "residual_scale",
                             "chi_square", "halves", "bias", "unseen_arm"})
      EXPECT_TRUE(gate(anchor.estimate, name).value) << name;
  }
}

TEST(Gates, HoldBackAnAnchorThatMovedInTheMiddleOfTheFlight) {
  MadeFlight before;
  before.turn_rate_radps = 0.2;
  MadeFlight after = before;
  after.anchors[0] += Eigen::Vector3d(0.6, -0.5, 0);
  FlightData flight = make_flight(before);
  const FlightData moved = make_flight(after);
  for (std::size_t i = 0; i < flight.ranges.size(); ++i) {
    if (seconds_between(UtcTime{}, flight.ranges[i].time) > 60) flight.ranges[i] = moved.ranges[i];
  }
  const auto s = solve_flight(flight);
  ASSERT_TRUE(s);
  const Estimate& e = s.value().anchors[0].estimate;
  EXPECT_FALSE(gate(e, "halves").passed) << gate(e, "halves").why;
  EXPECT_FALSE(e.acceptable());
  EXPECT_TRUE(s.value().anchors[2].estimate.acceptable());
}

TEST(Gates, HoldBackAFlightAtOneHeight) {
  MadeFlight made;
  made.height_swing_m = 0;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) {
    EXPECT_FALSE(gate(anchor.estimate, "side").passed);
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
}

TEST(Gates, HoldBackALineFlight) {
  MadeFlight made;
  made.height_swing_m = 0.05;
  made.width_m = 0.1;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) EXPECT_FALSE(gate(anchor.estimate, "geometry").passed);
}

// 0.3 m beside the truth, in every direction of the body; a third of a turn every 6 or every 20 seconds.
TEST(Gates, CatchALeverArmDeclaredWronglyWhereverTheAircraftTurns) {
  int flights = 0, caught = 0, accepted = 0, right_accepted = 0, right_anchors = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    for (const double turn_radps : {0.35, 0.1}) {
      MadeFlight made;
      made.seed = seed;
      made.turn_rate_radps = turn_radps;
      const double way = 1.3 * static_cast<double>(seed);
      made.arm_error_m = {0.3 * std::cos(way), 0.3 * std::sin(way), 0};
      const auto wrong = solve_flight(make_flight(made));
      ASSERT_TRUE(wrong);
      ++flights;
      for (const auto& anchor : wrong.value().anchors) accepted += anchor.estimate.acceptable() ? 1 : 0;
      const auto& gates = wrong.value().anchors[0].estimate.gates;
      caught += std::ranges::any_of(gates, [](const Gate& g) { return g.name == "lever_arm" && !g.passed; });
      made.arm_error_m.setZero();
      const auto right = solve_flight(make_flight(made));
      ASSERT_TRUE(right);
      for (const auto& anchor : right.value().anchors) {
        right_accepted += anchor.estimate.acceptable() ? 1 : 0;
        ++right_anchors;
      }
    }
  }
  EXPECT_EQ(caught, flights);
  EXPECT_EQ(accepted, 0);
  EXPECT_EQ(right_accepted, right_anchors);
}

TEST(Gates, HoldBackAFlightThatContradictsTheKitsOthers) {
  std::vector<FlightData> flights;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    MadeFlight made;
    made.seed = seed;
    made.bias_m = seed == 4 ? 0.9 : 0.3;  // another tag was put on before the fourth flight
    flights.push_back(make_flight(made));
  }
  std::vector<const FlightData*> pointers;
  for (const auto& flight : flights) pointers.push_back(&flight);
  const auto odd = solve_flights(pointers);
  ASSERT_TRUE(odd);
  const Estimate& e = odd.value()[3].anchors[0].estimate;
  EXPECT_FALSE(gate(e, "profile").passed) << gate(e, "profile").why;
  EXPECT_NE(gate(e, "profile").why.find("range bias"), std::string::npos);
  EXPECT_FALSE(e.acceptable());
  pointers.pop_back();
  const auto alike = solve_flights(pointers);
  ASSERT_TRUE(alike);
  for (const auto& s : alike.value()) EXPECT_TRUE(gate(s.anchors[0].estimate, "profile").passed) << s.name;
}

TEST(Gates, HoldBackTooFewRanges) {
  auto flight = make_flight(MadeFlight{});
  std::size_t seen = 0;
  std::erase_if(flight.ranges, [&](const Range& r) { return r.anchor.value == 0x6003 && seen++ % 40 != 0; });
  const auto s = solve_flight(flight);
  ASSERT_TRUE(s);
  EXPECT_FALSE(gate(s.value().anchors[3].estimate, "redundancy").passed);
}

TEST(Gates, AreNeverPassedByAnEstimateWithoutAny) {
  Estimate estimate;
  estimate.verdict = Verdict::ok;
  estimate.best.emplace();
  EXPECT_FALSE(estimate.acceptable());
  estimate.gates.push_back({"redundancy", 40.0, 30.0, true, ""});
  EXPECT_TRUE(estimate.acceptable());
  estimate.gates.push_back({"halves", std::nullopt, 16.3, false, "no answer"});
  EXPECT_FALSE(estimate.acceptable());
}

TEST(Gates, TellHeightsApartThatThreeAxesTogetherWouldPass) {
  const auto at = [](const Eigen::Vector3d& m) {
    Estimate e;
    e.best.emplace();
    e.best->position.m = m;
    e.best->covariance_m2 = Eigen::Vector3d(0.03, 0.03, 0.14).array().square().matrix().asDiagonal();
    return e;
  };
  const Estimate before = at({1, 2, 3});
  // Of sigma 0.198 m of the difference: 3.54 sigmas, chi2 12.5, below 16.3 of three degrees of freedom.
  const Gate higher = moved_gate(at({1, 2, 3.7}), before);
  EXPECT_FALSE(higher.passed) << higher.why;
  EXPECT_NEAR(*higher.value, 12.5, 0.01);
  EXPECT_NEAR(higher.limit, 10.83, 0.02) << "chi-square, 99.9 %, one degree of freedom";
  EXPECT_TRUE(moved_gate(at({1, 2, 3.6}), before).passed);
  // Two degrees of freedom: 13.8.
  EXPECT_FALSE(moved_gate(at({1.11, 2.115, 3}), before).passed);
  EXPECT_TRUE(moved_gate(at({1.1, 2.1, 3}), before).passed);
}

TEST(Gates, TellAMovedAnchorFromOneThatStayed) {
  MadeFlight first;
  first.turn_rate_radps = 0.2;
  MadeFlight second = first;
  second.seed = 2;
  second.anchors[1] += Eigen::Vector3d(0.5, 0.5, 0);
  const auto a = solve_flight(make_flight(first));
  const auto b = solve_flight(make_flight(second));
  ASSERT_TRUE(a);
  ASSERT_TRUE(b);
  const auto at = [](const auto& s, std::size_t i) { return s.value().anchors[i].estimate; };
  EXPECT_TRUE(moved_gate(at(b, 0), at(a, 0)).passed);
  EXPECT_FALSE(moved_gate(at(b, 1), at(a, 1)).passed);
  EXPECT_FALSE(moved_gate(Estimate{}, at(a, 1)).passed);
  const Estimate stayed[] = {at(a, 0), at(b, 0)}, moved[] = {at(a, 1), at(b, 1)};
  EXPECT_TRUE(fuse_estimates(stayed).acceptable());
  EXPECT_FALSE(fuse_estimates(moved).acceptable());
  EXPECT_FALSE(gate(fuse_estimates(moved), "flights").passed);
}

// One ring at one height leaves the height open, and knows very well where an anchor hangs horizontally.
TEST(Gates, HoldBackAnAnchorThatASecondFlightOfOneHeightHasElsewhere) {
  MadeFlight first;
  first.turn_rate_radps = 0.2;
  const auto before = solve_flight(make_flight(first));
  ASSERT_TRUE(before);
  Estimate known = before.value().anchors[0].estimate;
  ASSERT_TRUE(known.acceptable()) << known.reason;
  const auto second = [&](const Eigen::Vector3d& moved) {
    Estimate out = known;
    out.verdict = Verdict::ambiguous;
    out.best->position.m += moved;
    out.mirror = out.best;
    out.mirror->position.m.z() -= 4;
    return out;
  };
  const Estimate stayed[] = {known, second({0, 0, 1.5})}, moved[] = {known, second({2, 0, 0})};
  EXPECT_TRUE(fuse_estimates(stayed).acceptable());
  const Estimate held = fuse_estimates(moved);
  EXPECT_FALSE(held.acceptable());
  EXPECT_FALSE(gate(held, "flights").passed);
  EXPECT_NE(held.reason.find("2.00 m away horizontally"), std::string::npos) << held.reason;
}

// Every range to one anchor goes through a wall: half a metre and an exponential delay on top. It fits a
// place behind the anchor, and only beside the others it shows.
TEST(Gates, HoldBackAnAnchorWhoseRangesAreAllBlocked) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    MadeFlight made;
    made.seed = seed;
    FlightData flight = make_flight(made);
    std::mt19937_64 random(seed);
    std::exponential_distribution<double> late_m(1 / 0.3);
    for (auto& range : flight.ranges)
      if (range.anchor.value == 0x6000) range.distance_m += 0.5 + late_m(random);
    const auto s = solve_flight(flight);
    ASSERT_TRUE(s);
    const auto& anchors = s.value().anchors;
    EXPECT_GT((anchors[0].estimate.best.value().position.m - made.anchors[0]).norm(), 0.2);
    EXPECT_FALSE(gate(anchors[0].estimate, "blocked").passed) << gate(anchors[0].estimate, "blocked").why;
    for (std::size_t i = 1; i < anchors.size(); ++i)
      EXPECT_TRUE(gate(anchors[i].estimate, "blocked").passed) << gate(anchors[i].estimate, "blocked").why;
  }
}

TEST(Gates, HoldBackAHeightThatNoFlightSaw) {
  MadeFlight made;
  made.height_swing_m = 0.7;  // the third anchor is at the height of the flight: how high it is hardly shows
  made.anchors = {{12, 2, 5.5}, {-10, 8, 5.6}, {3, -14, 6.3}};
  made.noise_m = 0.5;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  const auto sigma_share = [](const AnchorSolution& anchor, int axis) {
    const auto& c = anchor.estimate.best.value().covariance_m2;
    return std::sqrt(c(axis, axis)) / anchor.geometry.median_range_m;
  };
  const auto& level = s.value().anchors[2];
  ASSERT_LT(std::max(sigma_share(level, 0), sigma_share(level, 1)), 0.02);
  ASSERT_GT(sigma_share(level, 2), 0.1);
  EXPECT_FALSE(gate(level.estimate, "precision").passed);
  for (std::size_t i = 0; i < 2; ++i) {
    ASSERT_LT(sigma_share(s.value().anchors[i], 2), 0.08);
    EXPECT_TRUE(gate(s.value().anchors[i].estimate, "precision").passed);
  }
}

TEST(Gates, UseTheTabulatedQuantilesOfChiSquare) {
  // Tables: 16.27 (3, 99.9 %), 7.815 (3, 95 %), 29.59 (10, 99.9 %).
  EXPECT_NEAR(chi2_quantile(0.999, 3), 16.27, 0.02 * 16.27);
  EXPECT_NEAR(chi2_quantile(0.95, 3), 7.815, 0.02 * 7.815);
  EXPECT_NEAR(chi2_quantile(0.999, 10), 29.59, 0.02 * 29.59);
}

TEST(Residuals, ListEveryPlacedRangeAndMarkTheRejected) {
  MadeFlight made;
  made.nlos_share = 0.1;
  const auto s = solve_flight(make_flight(made));
  ASSERT_TRUE(s);
  for (const auto& anchor : s.value().anchors) {
    const auto rejected =
        std::ranges::count_if(anchor.residuals, [](const RangeResidual& r) { return r.weight == 0; });
    EXPECT_EQ(static_cast<std::size_t>(rejected), anchor.estimate.refused.at("outlier"));
    EXPECT_EQ(anchor.residuals.size() - static_cast<std::size_t>(rejected), anchor.estimate.n_used);
    for (const auto& r : anchor.residuals) {
      EXPECT_GT(r.sigma_m, 0.0);
      EXPECT_LE(std::abs(r.residual_m) / r.sigma_m, std::abs(r.standardised) * (1 + 1e-9))
          << "redundancy below 1";
      // Baarda: beyond 3.3 sigmas rejected, far inside kept.
      if (std::abs(r.standardised) > 3.8) {
        EXPECT_EQ(r.weight, 0.0);
      }
      if (std::abs(r.standardised) < 2.0) {
        EXPECT_GT(r.weight, 0.0);
      }
    }
  }
}

}  // namespace
}  // namespace anchord::gates_test
