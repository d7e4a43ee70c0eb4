// What is said where the ranges put an anchor elsewhere than the turn or the height search did.
#include "core/localize/prior_conflict.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "core/localize/flight_solver.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::prior_conflict_test {
namespace {

bool says(const std::string& text, const char* words) { return text.find(words) != std::string::npos; }

TEST(PriorConflict, NamesBothValuesBeyondThreeSigmasAlone) {
  AnchorPriors priors;
  priors.height = {8.0, 0.5};
  priors.bearing = {{0, 0, 5}, std::numbers::pi / 2, 0.35};  // east
  EXPECT_EQ(prior_conflict(priors, {10, 1, 6.6}, Dims::three), "") << "2.8 sigmas, and 0.3";
  const std::string up = prior_conflict(priors, {10, 1, 6.0}, Dims::three);
  EXPECT_TRUE(says(up, "the height 8.00 m above the origin") &&
              says(up, "disagrees with the ranges, 6.00 m (4.0 sigma)"))
      << up;
  EXPECT_FALSE(says(up, "bearing"));
  const std::string aside = prior_conflict(priors, {-10, 0.1, 8}, Dims::three);
  EXPECT_TRUE(says(aside, "the bearing 90 degrees") && says(aside, "disagrees with the ranges, 271 degrees"))
      << aside;
  EXPECT_EQ(prior_conflict(priors, {10, 1, 0.0}, Dims::two), "") << "its height is held";
  EXPECT_EQ(prior_conflict(priors, {-0.1, 0, 8}, Dims::three), "") << "right above where it turned";
  EXPECT_EQ(prior_conflict({}, {10, 1, 0.0}, Dims::three), "");
}

TEST(PriorConflict, IsTheReasonOfAnEstimateThatIsOtherwiseGood) {
  const testing::MadeFlight made;
  const FlightData flight = testing::make_flight(made);
  FlightOptions options;
  const NetworkId id{0x6000};
  options.priors[id].height = {made.anchors[0].z() + 6.0, 0.5};
  const FlightSolution solution = solve_flight(flight, options).value();
  const Estimate& estimate = solution.anchors[0].estimate;
  EXPECT_EQ(estimate.verdict, Verdict::ok);
  EXPECT_TRUE(says(estimate.reason, "the height 7.50 m above the origin")) << estimate.reason;
  EXPECT_NEAR(estimate.best->position.m.z(), made.anchors[0].z(), 0.2) << "the ranges count";
  for (std::size_t i = 1; i < solution.anchors.size(); ++i)
    EXPECT_EQ(solution.anchors[i].estimate.reason, "") << i;
}

}  // namespace
}  // namespace anchord::prior_conflict_test
