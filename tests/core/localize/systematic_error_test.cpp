// Ranges or tracks that are right but for a factor, a step or a drift. Truth and ranges are made from a path
// in closed form: the error put in is the error to be found.
#include "core/localize/systematic_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::systematic_error_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;
using testing::turning;

const Gate& gate_named(const AnchorSolution& anchor, const char* name) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, name, &Gate::name);
  EXPECT_NE(at, gates.end());
  static const Gate none;
  return at == gates.end() ? none : *at;
}

const Gate& scale_gate(const AnchorSolution& anchor) { return gate_named(anchor, "range_scale"); }

/// Median height of the track.
double middle_up_m(const FlightData& flight) {
  std::vector<double> ups_m;
  for (const Fix& fix : flight.fixes) ups_m.push_back(fix.local_m.z());
  std::ranges::nth_element(ups_m, ups_m.begin() + static_cast<std::ptrdiff_t>(ups_m.size() / 2));
  return ups_m[ups_m.size() / 2];
}

/// Height of the first track point at or after a time.
double up_at(const FlightData& flight, double t_s) {
  const auto at = std::ranges::lower_bound(flight.fixes, UtcTime::from_seconds(t_s), {}, &Fix::time);
  return at == flight.fixes.end() ? flight.fixes.back().local_m.z() : at->local_m.z();
}

/// How much of the flight has passed.
double share_of(const FlightData& flight, UtcTime time) {
  const double from_s = flight.fixes.front().time.seconds();
  return (time.seconds() - from_s) / (flight.fixes.back().time.seconds() - from_s);
}

void expect_says(const Gate& gate, const char* words) {
  EXPECT_NE(gate.why.find(words), std::string::npos) << gate.why;
}

/// Every anchor is withheld by the gate, which says so and is off by `value`, give or take `within`.
void expect_withheld(const FlightSolution& solution, const char* name, const char* words, double value,
                     double within) {
  for (const AnchorSolution& anchor : solution.anchors) {
    const Gate& gate = gate_named(anchor, name);
    EXPECT_FALSE(gate.passed) << gate.why;
    EXPECT_NEAR(gate.value.value_or(0), value, within);
    expect_says(gate, words);
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
}

// A server that is told to end waited minutes for the solution of a flight with thousands of anchors.
TEST(SystematicErrors, ASolutionThatIsCanceledWhileItAsksForErrorsEndsThere) {
  const FlightData flight = make_flight(turning(1));
  std::size_t n_asked = 0, end_at = 0;
  FlightOptions options;
  options.canceled = [&] { return ++n_asked > end_at; };
  end_at = ~std::size_t{0};
  ASSERT_TRUE(solve_flight(flight, options));
  const std::size_t n_all = n_asked;
  // The last questions, one by one: errors of all ranges and of each anchor, then what is described.
  for (std::size_t back = 1; back <= 12; ++back) {
    n_asked = 0;
    end_at = n_all - back;
    const auto solution = solve_flight(flight, options);
    ASSERT_FALSE(solution) << back;
    EXPECT_EQ(solution.error().code, Errc::canceled);
    EXPECT_EQ(n_asked, end_at + 1) << "it ends with the answer";
  }
  EXPECT_GT(n_all, 12U + flight.mission.tags.size());
}

TEST(SystematicErrors, WithholdsEveryAnchorWhereAllRangesHaveAFactor) {
  for (const double factor : {0.9, 0.97, 1.02, 1.05, 1.1}) {
    for (const std::uint64_t seed : {1, 2}) {
      FlightData flight = make_flight(turning(seed));
      for (Range& range : flight.ranges) range.distance_m *= factor;
      const FlightSolution solution = solve_flight(flight).value();
      EXPECT_NEAR(solution.shared.range_scale.value, factor - 1, 0.005);
      EXPECT_GT(std::abs(solution.shared.range_scale_z), 4);
      for (const AnchorSolution& anchor : solution.anchors) {
        const Gate& gate = scale_gate(anchor);
        EXPECT_FALSE(gate.passed) << factor << ' ' << gate.why;
        EXPECT_GT(gate.value.value_or(0), gate.limit);
        expect_says(gate, factor > 1 ? "too long by a factor (all ranges)" : "too short by a factor");
        expect_says(gate, "check the unit of the ranges");
        EXPECT_FALSE(anchor.estimate.acceptable());
      }
    }
  }
}

TEST(SystematicErrors, NamesTheAntennaWhoseRangesHaveAFactor) {
  FlightData flight = make_flight(turning(3));
  flight.mission.tags.push_back({NetworkId{0x6e02}, 0, {0, 0, 0}});
  for (std::size_t i = 0; i < flight.ranges.size(); i += 2) {
    flight.ranges[i].tag = NetworkId{0x6e02};
    flight.ranges[i].distance_m *= 1.05;
  }
  const FlightSolution solution = solve_flight(flight).value();
  for (const AnchorSolution& anchor : solution.anchors) {
    EXPECT_FALSE(scale_gate(anchor).passed);
    expect_says(scale_gate(anchor), "0x6e02");
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
}

TEST(SystematicErrors, WithholdsTheOneAnchorWhoseRangesHaveAFactor) {
  FlightData flight = make_flight(turning(4));
  for (Range& range : flight.ranges)
    if (range.anchor == NetworkId{0x6001}) range.distance_m *= 1.03;
  const FlightSolution solution = solve_flight(flight).value();
  for (const AnchorSolution& anchor : solution.anchors) {
    const bool has_one = anchor.estimate.anchor == NetworkId{0x6001};
    EXPECT_EQ(scale_gate(anchor).passed, !has_one) << scale_gate(anchor).why;
    if (has_one) expect_says(scale_gate(anchor), "of this anchor");
  }
}

TEST(SystematicErrors, LeavesGoodFlightsAccepted) {
  for (const std::uint64_t seed : {11, 12, 13, 14, 15, 16}) {
    MadeFlight made = turning(seed);
    // None of them is a factor.
    made.bias_m = seed % 2 == 0 ? 0.5 : 0.0;
    made.lag_s = 0.1;
    const FlightSolution solution = solve_flight(make_flight(made)).value();
    EXPECT_LT(std::abs(solution.shared.range_scale.value), 0.005);
    for (const AnchorSolution& anchor : solution.anchors) {
      EXPECT_TRUE(scale_gate(anchor).passed) << scale_gate(anchor).why;
      EXPECT_TRUE(anchor.estimate.acceptable()) << seed;
    }
  }
}

TEST(SystematicErrors, WithholdEveryAnchorWhereRangesMeasuredHighAreLate) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    FlightData flight = make_flight(turning(seed));
    const double middle_m = middle_up_m(flight);
    for (Range& range : flight.ranges)
      if (up_at(flight, range.time.seconds()) > middle_m) range.distance_m += 0.3;
    const FlightSolution solution = solve_flight(flight).value();
    for (const AnchorSolution& anchor : solution.anchors) {
      const Gate& gate = gate_named(anchor, "range_step");
      EXPECT_FALSE(gate.passed) << gate.why;
      expect_says(gate, "too long against those below");
      EXPECT_FALSE(anchor.estimate.acceptable());
    }
  }
}

/// Two rings round the building, at 3 and 9 m.
FlightData two_rings(std::uint64_t seed) {
  MadeFlight made = turning(seed);
  made.duration_s = 240;
  FlightData flight = make_flight(made);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  const auto place = [](double t_s) {
    return Eigen::Vector3d(19 * std::sin(t_s / 120 * 2 * std::numbers::pi),
                           14 * std::cos(t_s / 120 * 2 * std::numbers::pi), std::clamp(t_s - 114, 3.0, 9.0));
  };
  for (Fix& fix : flight.fixes)
    fix.local_m =
        place(fix.time.seconds()) + 0.005 * Eigen::Vector3d(noise(random), noise(random), noise(random));
  for (Range& range : flight.ranges)
    range.distance_m = (place(range.time.seconds()) - made.anchors[range.anchor.value - 0x6000]).norm() +
                       0.06 * noise(random);
  return flight;
}

TEST(SectorDoubt, HoldsWhereAnAnchorWouldBeWithoutADelayOfItsUpperRingAlone) {
  const Eigen::Vector3d truth_m = MadeFlight{}.anchors[1];
  int n_accepted_beyond = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    FlightData flight = two_rings(seed);
    for (Range& range : flight.ranges)
      if (range.anchor == NetworkId{0x6001} && range.time.seconds() >= 120) range.distance_m += 0.2;
    const FlightSolution solution = solve_flight(flight).value();
    const Estimate& late = solution.anchors[1].estimate;
    ASSERT_TRUE(late.best);
    const double up_m = std::abs(late.best->position.m.z() - truth_m.z());
    n_accepted_beyond += late.acceptable() && up_m > 1.5 * late.v95_m ? 1 : 0;
    for (const AnchorSolution& other : solution.anchors)
      if (other.estimate.anchor != NetworkId{0x6001}) {
        EXPECT_LT(other.estimate.v95_m, 0.6) << "honest ones pay nothing";
      }
  }
  EXPECT_LE(n_accepted_beyond, 2) << "of twelve";
}

TEST(JointModel, RangesThatAreAllFurtherApartThanTwoSecondsAreLooksOfTheirOwn) {
  const auto thinned_h95_m = [](double period_s) {
    FlightData flight = two_rings(3);
    std::map<NetworkId, double> last_s;
    std::erase_if(flight.ranges, [&](const Range& range) {
      auto [at, fresh] = last_s.try_emplace(range.anchor, -1e9);
      if (range.time.seconds() - at->second < period_s) return true;
      at->second = range.time.seconds();
      return false;
    });
    std::vector<double> h95_m;
    const FlightSolution solution = solve_flight(flight).value();
    for (const AnchorSolution& anchor : solution.anchors) {
      EXPECT_TRUE(anchor.estimate.acceptable()) << period_s << " s: " << anchor.estimate.reason;
      h95_m.push_back(anchor.estimate.h95_m);
    }
    return *std::ranges::max_element(h95_m);
  };
  const double dense_m = thinned_h95_m(1.9), sparse_m = thinned_h95_m(2.1);
  EXPECT_LT(sparse_m, 1.3 * dense_m);
  EXPECT_LT(thinned_h95_m(4.2), 2 * dense_m) << "half as many";
}

TEST(SystematicErrors, WithholdEveryAnchorWhereRangesDrift) {
  for (const double drift_m : {0.4, -0.4}) {
    FlightData flight = make_flight(turning(5));
    const double from_s = flight.ranges.front().time.seconds(),
                 length_s = flight.ranges.back().time.seconds() - from_s;
    for (Range& range : flight.ranges)
      range.distance_m += drift_m * (range.time.seconds() - from_s) / length_s;
    expect_withheld(solve_flight(flight).value(), "range_drift",
                    drift_m > 0 ? "the ranges grow by" : "the ranges shrink by", 0.4, 0.1);
  }
}

TEST(SystematicErrors, WithholdEveryAnchorWhereThePositionsDrift) {
  for (const Eigen::Vector3d& drift_m :
       {Eigen::Vector3d(0.6, 0, 0), Eigen::Vector3d(0, -0.6, 0), Eigen::Vector3d(0, 0, 0.8)}) {
    FlightData flight = make_flight(turning(6));
    for (Fix& fix : flight.fixes) fix.local_m += drift_m * share_of(flight, fix.time);
    expect_withheld(solve_flight(flight).value(), "track_drift",
                    drift_m.z() > 0   ? "in height"
                    : drift_m.x() > 0 ? "eastward"
                                      : "northward",
                    drift_m.norm(), 0.25 * drift_m.norm());
  }
}

TEST(SystematicErrors, WithholdEveryAnchorWhereThePositionsWander) {
  FlightData flight = make_flight(turning(8));
  for (Fix& fix : flight.fixes)
    fix.local_m.y() += 0.4 * std::cos(2 * std::numbers::pi * share_of(flight, fix.time));
  // The second Legendre polynomial's part of a cosine over its whole period is 15 / pi^2.
  expect_withheld(solve_flight(flight).value(), "track_drift", "northward to and fro during the flight",
                  0.4 * 15 / (std::numbers::pi * std::numbers::pi), 0.15);
}

TEST(SystematicErrors, WithholdEveryAnchorWhereTheHeightsOfTheTrackHaveAFactor) {
  for (const double factor : {0.85, 1.15}) {
    FlightData flight = make_flight(turning(7));
    for (Fix& fix : flight.fixes) fix.local_m.z() *= factor;
    expect_withheld(solve_flight(flight).value(), "track_heights",
                    factor > 1 ? "too far apart" : "too far together", 0.15, 0.04);
  }
}

TEST(SystematicErrors, LeaveGoodFlightsWithoutStepOrDrift) {
  for (const std::uint64_t seed : {11, 12, 13, 14, 15, 16}) {
    const FlightSolution solution = solve_flight(make_flight(turning(seed))).value();
    for (const AnchorSolution& anchor : solution.anchors) {
      for (const char* name : {"range_step", "range_drift", "track_drift", "track_heights"}) {
        const Gate& gate = gate_named(anchor, name);
        EXPECT_TRUE(gate.passed) << gate.why;
        EXPECT_LT(gate.value.value_or(1), 0.05) << name;
      }
    }
  }
}

// In a small hall ranges of real radios have a slope of their own: no factor is shown there.
TEST(SystematicErrors, TakesNoSlopeOfNearRangesForAFactor) {
  MadeFlight made = turning(21);
  made.anchors = {{8, 2, 1.5}, {-7, 4, 6}, {3, -9, 2}, {-6, -5, 9}};
  FlightData flight = make_flight(made);
  constexpr double k_size = 0.3;
  for (Fix& fix : flight.fixes) fix.local_m *= k_size;
  for (Range& range : flight.ranges)
    range.distance_m = range.distance_m * k_size + 0.05 * (std::min(range.distance_m * k_size, 5.0) - 2.5);
  const FlightSolution solution = solve_flight(flight).value();
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    EXPECT_TRUE(scale_gate(solution.anchors[i]).passed) << scale_gate(solution.anchors[i]).why;
    const Hypothesis& best = solution.anchors[i].estimate.best.value();
    const Eigen::Vector3d off = best.position.m - k_size * made.anchors[i];
    EXPECT_LT(off.dot(best.covariance_m2.inverse() * off), 7.815) << i;  // 95 %, three degrees
  }
}

}  // namespace
}  // namespace anchord::systematic_error_test
