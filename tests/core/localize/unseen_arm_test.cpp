// A lever arm that is wrong and shows in no range: of one heading it moves every anchor by its whole length,
// since the track and the arm are one rigid body.
#include "core/localize/unseen_arm.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord {
namespace {

using testing::MadeFlight;
using testing::make_flight;

MadeFlight turning(double rate_radps) {
  MadeFlight made;
  made.turn_rate_radps = rate_radps;
  return made;
}
FlightSolution solved(const FlightData& flight, const FlightOptions& options = {}) {
  auto solution = solve_flight(flight, options);
  EXPECT_TRUE(solution.has_value());
  return solution ? std::move(solution).value() : FlightSolution{};
}
std::optional<Gate> unseen(const AnchorSolution& anchor) {
  const auto& gates = anchor.estimate.gates;
  const auto at = std::ranges::find(gates, "unseen_arm", &Gate::name);
  return at != gates.end() ? std::optional(*at) : std::nullopt;
}

TEST(UnseenArm, OfOneHeadingMovesEveryAnchorByItsWholeLength) {
  const auto flight = solved(make_flight(turning(0)));
  ASSERT_FALSE(flight.anchors.empty());
  for (const AnchorSolution& anchor : flight.anchors) {
    const auto gate = unseen(anchor);
    ASSERT_TRUE(gate) << anchor.name;
    EXPECT_FALSE(gate->passed) << anchor.name;
    EXPECT_NEAR(gate->value.value_or(0), 0.3, 0.02) << anchor.name;
    EXPECT_LT(gate->limit, 0.3);
    EXPECT_NE(gate->why.find("turn the aircraft once over a point"), std::string::npos) << gate->why;
    EXPECT_FALSE(anchor.estimate.acceptable());
  }
}

TEST(UnseenArm, PassesWhereTheAircraftTurned) {
  for (const AnchorSolution& anchor : solved(make_flight(turning(0.2))).anchors) {
    ASSERT_TRUE(unseen(anchor)) << anchor.name;
    EXPECT_TRUE(unseen(anchor)->passed) << unseen(anchor)->why;
    EXPECT_TRUE(anchor.estimate.acceptable()) << anchor.name;
  }
}

TEST(UnseenArm, IsInTheRegionsWhereItsSigmaIsDeclared) {
  const FlightData flight = make_flight(turning(0));
  FlightOptions options;
  options.lever_arm_sigma_m = 0.05;
  const auto with = solved(flight, options), without = solved(flight);
  ASSERT_EQ(with.anchors.size(), without.anchors.size());
  for (std::size_t i = 0; i < with.anchors.size(); ++i) {
    EXPECT_FALSE(unseen(with.anchors[i]));
    ASSERT_TRUE(with.anchors[i].estimate.best && without.anchors[i].estimate.best);
    const Eigen::Matrix3d more_m2 =
        with.anchors[i].estimate.best->covariance_m2 - without.anchors[i].estimate.best->covariance_m2;
    for (const int axis : {0, 1}) EXPECT_NEAR(more_m2(axis, axis), 0.05 * 0.05, 0.0004) << axis;
    EXPECT_NEAR(more_m2(2, 2), 0, 0.0002);
    EXPECT_NEAR(with.anchors[i].budget->trace_m2(ErrorSource::lever_arm) -
                    without.anchors[i].budget->trace_m2(ErrorSource::lever_arm),
                2 * 0.05 * 0.05, 0.001);
  }
  // Of an aircraft that turned the same sigma is nearly nothing.
  const FlightData turned = make_flight(turning(0.2));
  const Eigen::Matrix3d more_m2 = solved(turned, options).anchors[0].estimate.best->covariance_m2 -
                                  solved(turned).anchors[0].estimate.best->covariance_m2;
  EXPECT_LT(more_m2.trace(), 0.1 * 2 * 0.05 * 0.05);
}

TEST(UnseenArm, IsNotAskedOfATrackThatIsTheTagsOwn) {
  FlightData flight = make_flight(turning(0));
  flight.mission.point = TrackPoint::tag_antenna;
  for (const AnchorSolution& anchor : solved(flight).anchors) EXPECT_FALSE(unseen(anchor)) << anchor.name;
}

TEST(UnseenArm, IsTheDeclaredArmAcrossWhereTheTrackHasNoHeading) {
  FlightData flight = make_flight(turning(0));
  for (Fix& fix : flight.fixes) fix.enu_from_body.reset();
  for (const AnchorSolution& anchor : solved(flight).anchors)
    EXPECT_FALSE(unseen(anchor)) << anchor.name << ": an arm straight up needs no heading";
  for (auto& tag : flight.mission.tags) tag.lever_arm_body_m = {0.3, 0.4, 0};
  for (const AnchorSolution& anchor : solved(flight).anchors) {
    ASSERT_TRUE(unseen(anchor)) << anchor.name;
    EXPECT_FALSE(unseen(anchor)->passed);
    EXPECT_NEAR(unseen(anchor)->value.value_or(0), 0.5, 1e-6);
    EXPECT_NE(unseen(anchor)->why.find("record the attitude"), std::string::npos) << unseen(anchor)->why;
  }
}

TEST(UnseenArm, RefusesASigmaThatIsNone) {
  for (const double wrong : {0.0, -0.1}) {
    FlightOptions options;
    options.lever_arm_sigma_m = wrong;
    EXPECT_FALSE(options.check()) << wrong;
  }
}

}  // namespace
}  // namespace anchord
