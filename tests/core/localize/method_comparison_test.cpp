// The dissertation's methods beside the joint solution (chapter 7).
#include "core/localize/method_comparison.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "flight_support.hpp"

namespace anchord::method_comparison_test {
namespace {

using testing::MadeFlight;

struct Errors {
  double linear_m{}, wls_m{}, joint_m{};
};
Errors mean_errors(const MadeFlight& m) {
  const FlightData flight = testing::make_flight(m);
  const auto joint = solve_flight(flight);
  const auto others = compare_methods(flight, {}, std::nullopt);
  EXPECT_TRUE(joint.has_value() && others.has_value());
  Errors out;
  const double n = static_cast<double>(m.anchors.size());
  for (std::size_t i = 0; i < m.anchors.size(); ++i) {
    const auto& anchor = joint.value().anchors[i];
    const auto& other = others.value().at(anchor.estimate.anchor);
    out.linear_m += (*other.linear_m - m.anchors[i]).norm() / n;
    out.wls_m += (*other.wls_m - m.anchors[i]).norm() / n;
    out.joint_m += (anchor.estimate.best->position.m - m.anchors[i]).norm() / n;
  }
  std::printf("linear %.3f m, weighted %.3f m, joint %.3f m\n", out.linear_m, out.wls_m, out.joint_m);
  return out;
}

TEST(Methods, AgreeWhereRangesAreExact) {
  MadeFlight m;
  m.noise_m = 0;
  const Errors e = mean_errors(m);  // the positions have 5 mm of noise each
  EXPECT_LT(e.linear_m, 0.02);
  EXPECT_LT(e.wls_m, 0.005);
}

TEST(Methods, OfTheDissertationDoNotKnowABiasAndTheJointOneDoes) {
  MadeFlight m;
  m.bias_m = 0.5;
  m.nlos_share = 0.2;
  const Errors e = mean_errors(m);
  EXPECT_GT(e.wls_m, 2 * e.joint_m);
  EXPECT_GT(e.linear_m, 2 * e.joint_m);
}

TEST(Methods, AnswerInPlaceOfTheJointOneWithoutBeingAcceptable) {
  MadeFlight m;
  m.frame = TrackFrame::wgs84;
  const FlightData flight = testing::make_flight(m);
  auto solved = solve_flight(flight);
  ASSERT_TRUE(solved.has_value());
  FlightSolution& solution = solved.value();
  const auto answers = compare_methods(flight, {}, solution.origin);
  ASSERT_TRUE(answers.has_value());
  FlightSolution joint = solution;
  answer_by(AnchorMethod::joint, answers.value(), joint);
  EXPECT_EQ(joint.anchors[0].estimate.best->position.m, solution.anchors[0].estimate.best->position.m);
  answer_by(AnchorMethod::wls, answers.value(), solution);
  for (const auto& anchor : solution.anchors) {
    const auto& e = anchor.estimate;
    EXPECT_EQ(e.best->position.m, *answers.value().at(e.anchor).wls_m);
    EXPECT_TRUE(e.best->wgs84.has_value());
    EXPECT_GT(e.h95_m, 0);
    EXPECT_FALSE(e.acceptable());
  }
  answer_by(AnchorMethod::linear, answers.value(), solution);
  EXPECT_TRUE(std::isnan(solution.anchors[0].estimate.h95_m));
  EXPECT_FALSE(solution.anchors[0].estimate.acceptable());
}

TEST(Methods, TellWhyTheyHaveNoAnswer) {
  MadeFlight m;
  FlightData flight = testing::make_flight(m);
  std::erase_if(flight.ranges,
                [](const Range& r) { return r.anchor == NetworkId{0x6000} && r.time.seconds() > 0.6; });
  const auto answers = compare_methods(flight, {}, std::nullopt);
  ASSERT_TRUE(answers.has_value());
  const auto& none = answers.value().at(NetworkId{0x6000});
  EXPECT_FALSE(none.linear_m.has_value());
  EXPECT_NE(none.why.find("linear: "), std::string::npos);
}

}  // namespace
}  // namespace anchord::method_comparison_test
