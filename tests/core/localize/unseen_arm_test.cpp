// A lever arm that is wrong, where the flight shows it and where it does not. Expected values are algebra:
// where the heading stays, ranges from antennas that are all off by e are the ranges of anchors that are off
// by -e.
#include "core/localize/unseen_arm.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::unseen_arm_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

constexpr double k_asked_m = 0.3;

const Gate* unseen(const AnchorSolution& anchor) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, "unseen_arm", &Gate::name);
  return at == gates.end() ? nullptr : &*at;
}

FlightSolution solved(const FlightData& flight, const FlightOptions& options = {}) {
  return solve_flight(flight, options).value();
}

/// The same heading for the whole flight.
FlightData with_heading(const MadeFlight& made, double heading_rad) {
  FlightData flight = make_flight(made);
  for (Fix& fix : flight.fixes)
    fix.enu_from_body = Eigen::Quaterniond(Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()));
  return flight;
}

TEST(UnseenArm, MovesEveryAnchorByTheWholeErrorWhereTheHeadingStays) {
  for (const double heading_rad : {0.0, 1.0, -2.5}) {
    for (const auto& anchor : solved(with_heading(MadeFlight{}, heading_rad)).anchors) {
      const Gate* gate = unseen(anchor);
      ASSERT_NE(gate, nullptr);
      EXPECT_NEAR(gate->value.value(), k_asked_m, 0.01) << heading_rad;  // weak priors hold a little of it
      EXPECT_FALSE(gate->passed);
      EXPECT_FALSE(anchor.estimate.acceptable());
      // What to do.
      EXPECT_NE(gate->why.find("quarter turn"), std::string::npos) << gate->why;
      EXPECT_NE(gate->why.find("lever_arm_sigma_m"), std::string::npos) << gate->why;
    }
  }
}

TEST(UnseenArm, IsWhatAWrongArmDoesToTheAnswer) {
  MadeFlight made;
  made.noise_m = 0.005;
  const FlightSolution right = solved(make_flight(made));
  made.arm_error_m = {0.18, -0.24, 0};  // 0.3 m long; heading east: body and map axes are the same
  const FlightSolution wrong = solved(make_flight(made));
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const Eigen::Vector3d moved =
        wrong.anchors[i].estimate.best->position.m - right.anchors[i].estimate.best->position.m;
    EXPECT_NEAR((moved + made.arm_error_m).norm(), 0, 0.01) << i;
    EXPECT_FALSE(wrong.anchors[i].estimate.acceptable());
  }
}

TEST(UnseenArm, IsSeenByAnAircraftThatTurns) {
  MadeFlight made;
  made.turn_rate_radps = 0.2;
  for (const auto& anchor : solved(make_flight(made)).anchors) {
    const Gate* gate = unseen(anchor);
    ASSERT_NE(gate, nullptr);
    EXPECT_TRUE(gate->passed) << gate->why;
    EXPECT_LT(gate->value.value(), 0.1);
    EXPECT_TRUE(anchor.estimate.acceptable());
  }
}

// The compass of an aircraft that turned all the time stood still; the arm's own accuracy says nothing then.
TEST(UnseenArm, BelievesNoHeadingThatIsTheSameToTheLastDigit) {
  MadeFlight made;
  made.turn_rate_radps = 0.2;
  made.arm_error_m = {0.3, 0, 0};
  FlightData flight = make_flight(made);
  flight.mission.tags.front().lever_arm_body_m += made.arm_error_m;
  FlightOptions options;
  options.lever_arm_sigma_m = 0.02;
  const FlightSolution right = solved(flight, options);
  for (const auto& anchor : right.anchors) EXPECT_TRUE(anchor.estimate.acceptable());
  for (Fix& fix : flight.fixes) fix.enu_from_body = flight.fixes.front().enu_from_body;
  const FlightSolution still = solved(flight, options);
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    ASSERT_NE(unseen(still.anchors[i]), nullptr);
    if (!unseen(still.anchors[i])->passed) continue;
    const Hypothesis& best = still.anchors[i].estimate.best.value();
    const Eigen::Vector3d off = best.position.m - made.anchors[i];
    EXPECT_LT(off.dot(best.covariance_m2.inverse() * off), 7.815) << i;  // 95 %, three degrees
  }
  EXPECT_TRUE(std::ranges::any_of(still.notes, [](const std::string& note) {
    return note.find("the heading of the track is the same in all positions") != std::string::npos;
  }));
}

TEST(UnseenArm, BelievesAHeadingThatIsHeldButMeasured) {
  FlightData flight = make_flight(MadeFlight{});
  flight.mission.tags.front().lever_arm_body_m.x() = 0.3;
  for (std::size_t i = 0; i < flight.fixes.size(); ++i)
    flight.fixes[i].enu_from_body = Eigen::Quaterniond(
        Eigen::AngleAxisd(0.002 * std::sin(static_cast<double>(i)), Eigen::Vector3d::UnitZ()));
  for (const std::string& note : solved(flight).notes)
    EXPECT_EQ(note.find("the heading of the track"), std::string::npos) << note;
}

// What the sentence tells the operator to do.
TEST(UnseenArm, IsSeenWhereTheHeadingIsAQuarterTurnAwayForTwentySeconds) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    MadeFlight made;
    made.seed = seed;
    FlightData flight = make_flight(made);
    for (Fix& fix : flight.fixes) {
      const double t_s = seconds_between(UtcTime{}, fix.time);
      if (t_s > 50 && t_s < 70)
        fix.enu_from_body =
            Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
    }
    for (const auto& anchor : solved(flight).anchors)
      EXPECT_TRUE(anchor.estimate.acceptable()) << seed << ' ' << unseen(anchor)->why;
  }
}

TEST(UnseenArm, WidensRegionsByExactlyTheSigmaThatIsDeclared) {
  const FlightData flight = make_flight(MadeFlight{});
  const FlightSolution without = solved(flight);
  for (const double sigma_m : {0.02, 0.15}) {
    FlightOptions options;
    options.lever_arm_sigma_m = sigma_m;
    const FlightSolution with = solved(flight, options);
    for (std::size_t i = 0; i < with.anchors.size(); ++i) {
      const Eigen::Matrix3d more_m2 =
          with.anchors[i].estimate.best->covariance_m2 - without.anchors[i].estimate.best->covariance_m2;
      Eigen::Matrix3d expected_m2 = Eigen::Matrix3d::Zero();
      expected_m2(0, 0) = expected_m2(1, 1) = sigma_m * sigma_m;
      EXPECT_NEAR((more_m2 - expected_m2).norm(), 0, 0.05 * sigma_m * sigma_m) << sigma_m << ' ' << i;
      EXPECT_EQ(unseen(with.anchors[i]), nullptr);
      EXPECT_EQ(with.anchors[i].estimate.best->position.m, without.anchors[i].estimate.best->position.m);
      ASSERT_TRUE(with.anchors[i].budget.has_value());
      EXPECT_NEAR(with.anchors[i].budget->trace_m2(ErrorSource::lever_arm) -
                      without.anchors[i].budget->trace_m2(ErrorSource::lever_arm),
                  2 * sigma_m * sigma_m, 0.1 * sigma_m * sigma_m);
    }
  }
}

// Nobody has to say it twice: a mission that declares it is solved as if the options had.
TEST(UnseenArm, OfAMissionThatDeclaresTheSigmaIsHeldAsOneOfTheOptions) {
  FlightData flight = make_flight(MadeFlight{});
  FlightOptions options;
  options.lever_arm_sigma_m = 0.03;
  const FlightSolution asked = solved(flight, options);
  flight.mission.lever_arm_sigma_m = 0.03;
  const FlightSolution declared = solved(flight);
  options.lever_arm_sigma_m = 0.15;
  const FlightSolution other = solved(flight, options);
  EXPECT_EQ(declared.shared.lever_arm_sigma_m, 0.03);
  EXPECT_EQ(other.shared.lever_arm_sigma_m, 0.15) << "what is asked for comes before it";
  for (std::size_t i = 0; i < declared.anchors.size(); ++i) {
    const Estimate& estimate = declared.anchors[i].estimate;
    EXPECT_TRUE(estimate.acceptable()) << i;
    EXPECT_EQ(estimate.best->covariance_m2, asked.anchors[i].estimate.best->covariance_m2) << i;
    EXPECT_GT(other.anchors[i].estimate.h95_m, estimate.h95_m + 0.1) << i;
  }
}

TEST(UnseenArm, IsEachMissionsOwnWhereSeveralAreSolvedTogether) {
  FlightData careful = make_flight(MadeFlight{});
  MadeFlight second;
  second.seed = 2;
  FlightData unsaid = make_flight(second);
  careful.mission.lever_arm_sigma_m = 0.02;
  const FlightData* both[] = {&careful, &unsaid};
  const auto solutions = solve_flights(both).value();
  for (const auto& anchor : solutions[0].anchors) EXPECT_EQ(unseen(anchor), nullptr);
  for (const auto& anchor : solutions[1].anchors) {
    ASSERT_NE(unseen(anchor), nullptr);
    EXPECT_FALSE(unseen(anchor)->passed);
  }
}

TEST(UnseenArm, IsHeldByTheRegionsOfASigmaThatFits) {
  MadeFlight made;
  made.arm_error_m = {0.18, -0.24, 0};
  FlightOptions options;
  options.lever_arm_sigma_m = 0.2;
  const FlightSolution solution = solved(make_flight(made), options);
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const Estimate& estimate = solution.anchors[i].estimate;
    const Eigen::Vector3d off = estimate.best->position.m - made.anchors[i];
    EXPECT_LT(off.dot(estimate.best->covariance_m2.inverse() * off), 7.815) << i;  // 95 %, three degrees
  }
}

TEST(UnseenArm, IsNotAskedWhereTheTrackIsOfTheTagOrTheArmIsSolvedFor) {
  FlightData flight = make_flight(MadeFlight{});
  FlightOptions free;
  free.lever_across_prior_m = 0.3;
  for (const auto& anchor : solved(flight, free).anchors) EXPECT_EQ(unseen(anchor), nullptr);
  flight.mission.point = TrackPoint::tag_antenna;
  for (const auto& anchor : solved(flight).anchors) EXPECT_EQ(unseen(anchor), nullptr);
}

TEST(UnseenArm, IsTheArmItselfWhereTheTrackHasNoHeading) {
  FlightData flight = make_flight(MadeFlight{});
  for (Fix& fix : flight.fixes) fix.enu_from_body.reset();
  for (const auto& anchor : solved(flight).anchors) EXPECT_EQ(unseen(anchor), nullptr);
  for (TagAntenna& tag : flight.mission.tags) tag.lever_arm_body_m = {0.3, 0.4, 0};
  for (const auto& anchor : solved(flight).anchors) {
    const Gate* gate = unseen(anchor);
    ASSERT_NE(gate, nullptr);
    EXPECT_GE(gate->value.value(), 0.5 - 1e-6);
    EXPECT_FALSE(gate->passed);
    EXPECT_NE(gate->why.find("record the attitude"), std::string::npos) << gate->why;
  }
}

bool notes_no_arm(const FlightSolution& solution) {
  return std::ranges::any_of(solution.notes, [](const std::string& note) {
    return note.find("no lever arm is declared") != std::string::npos &&
           note.find("up to 0.3 m") != std::string::npos;
  });
}

// Flown with the tag 0.3 m beside the track point, and nobody wrote it down.
TEST(UnseenArm, IsToldAndHeldByTheRegionsWhereNeitherHeadingNorArmIsKnown) {
  for (const double turn_rate_radps : {0.0, 0.05, 0.3}) {
    MadeFlight made;
    made.arm_error_m = {0.18, -0.24, 0};
    made.turn_rate_radps = turn_rate_radps;
    FlightData flight = make_flight(made);
    flight.mission.tags.clear();
    for (Fix& fix : flight.fixes) fix.enu_from_body.reset();
    const FlightSolution solution = solved(flight);
    EXPECT_TRUE(notes_no_arm(solution));
    flight.mission.tags = {{NetworkId{0x6e01}, 0, {0, 0, 0}}};
    const FlightSolution declared = solved(flight);
    EXPECT_FALSE(notes_no_arm(declared)) << "zeros are a declaration";
    for (std::size_t i = 0; i < made.anchors.size(); ++i) {
      const Estimate& estimate = solution.anchors[i].estimate;
      const Eigen::Matrix3d more_m2 =
          estimate.best->covariance_m2 - declared.anchors[i].estimate.best->covariance_m2;
      Eigen::Matrix3d least_m2 = Eigen::Matrix3d::Zero();
      least_m2(0, 0) = least_m2(1, 1) = 0.15 * 0.15;  // 0.3 m is two sigma
      EXPECT_GE(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(more_m2 - least_m2).eigenvalues()[0], -1e-9);
      const Eigen::Vector3d off = estimate.best->position.m - made.anchors[i];
      EXPECT_LT(off.dot(estimate.best->covariance_m2.inverse() * off), 7.815) << turn_rate_radps << ' ' << i;
    }
  }
}

/// Two rings round a building, the upper one flown the other way round, nose ahead, the tag `left_m` beside
/// the track point: on one ring every range is longer than from the track, on the other shorter.
FlightData two_rings(double left_m) {
  MadeFlight made;
  FlightData flight = make_flight(made);
  const auto angle_rad = [](double t_s) { return t_s < 60 ? 0.21 * t_s : 0.21 * (120 - t_s); };
  const auto on_ring = [&](double t_s, double radius_m) {
    return Eigen::Vector3d(radius_m * std::cos(angle_rad(t_s)), radius_m * std::sin(angle_rad(t_s)),
                           std::clamp(4.0 + 0.7 * (t_s - 55), 4.0, 11.0));
  };
  for (Fix& fix : flight.fixes) {
    fix.local_m = on_ring(fix.time.seconds(), 20);
    fix.enu_from_body.reset();
  }
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.04);
  for (Range& range : flight.ranges) {
    const double t_s = range.time.seconds();
    const double radius_m =
        t_s < 60 ? 20 - left_m : 20 + left_m;  // left of the course is inside, then outside
    const std::size_t anchor = range.anchor.value - 0x6000;
    range.distance_m = (on_ring(t_s, radius_m) - made.anchors[anchor]).norm() + noise(random);
  }
  return flight;
}

TEST(UnseenArm, ThatTurnsWithTheCourseMovesHeightsAndIsHeldByTheRegionsWhereNothingIsDeclared) {
  FlightData flight = two_rings(0.25);
  flight.mission.tags.clear();
  const MadeFlight made;
  double most_m = 0;
  const FlightSolution solution = solved(flight);
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const Estimate& estimate = solution.anchors[i].estimate;
    ASSERT_TRUE(estimate.best);
    const Eigen::Vector3d off = estimate.best->position.m - made.anchors[i];
    EXPECT_LT(std::abs(off.z()), estimate.v95_m) << i;
    most_m = std::max(most_m, std::abs(off.z()));
  }
  EXPECT_GT(most_m, 0.5) << "the arm is to move heights by more than its length";
}

TEST(UnseenArm, ThatTurnsWithTheCourseAndIsNotAppliedHoldsAnchorsBack) {
  FlightData flight = two_rings(0.25);
  flight.mission.tags = {{NetworkId{0x6e01}, 0, {0, 0.25, 0}}};
  double most_m = 0;
  for (const auto& anchor : solved(flight).anchors) {
    ASSERT_NE(unseen(anchor), nullptr);
    most_m = std::max(most_m, unseen(anchor)->value.value());
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
  EXPECT_GT(most_m, 0.5) << "the plane alone knows 0.25 m";
}

TEST(UnseenArm, OfTheTrackPointItselfIsNoQuestionWithoutAnArm) {
  FlightData flight = make_flight(MadeFlight{});
  flight.mission.tags.clear();
  for (Fix& fix : flight.fixes) fix.enu_from_body.reset();
  flight.mission.point = TrackPoint::tag_antenna;
  EXPECT_FALSE(notes_no_arm(solved(flight)));
}

// An arm that is measured to 2 cm and not applied is wrong by its whole length.
TEST(UnseenArm, IsNoSmallerForASigmaWhereTheArmIsNotApplied) {
  FlightData flight = make_flight(MadeFlight{});
  for (Fix& fix : flight.fixes) fix.enu_from_body.reset();
  for (TagAntenna& tag : flight.mission.tags) tag.lever_arm_body_m = {0.3, 0.4, 0};
  FlightOptions options;
  options.lever_arm_sigma_m = 0.02;
  for (const auto& anchor : solved(flight, options).anchors) {
    ASSERT_NE(unseen(anchor), nullptr);
    EXPECT_GE(unseen(anchor)->value.value(), 0.5 - 1e-6);
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
}

TEST(UnseenArm, RefusesASigmaThatIsNone) {
  FlightData flight = make_flight(MadeFlight{});
  for (const double sigma_m : {0.0, -0.1, 0.0009, 10.1, std::nan("")}) {
    FlightOptions options;
    options.lever_arm_sigma_m = sigma_m;
    EXPECT_FALSE(options.check()) << sigma_m;
    flight.mission.lever_arm_sigma_m = sigma_m;
    const auto refused = solve_flight(flight);
    ASSERT_FALSE(refused) << sigma_m;
    EXPECT_NE(refused.error().message.find("0.001 to 10 m"), std::string::npos) << refused.error().message;
  }
}

}  // namespace
}  // namespace anchord::unseen_arm_test
