// What withholds an anchor for the size of its region names where that size comes from. The flights are made
// so that one source alone can be the largest.
#include "core/localize/region_reason.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/localize/accuracy_goal.hpp"
#include "core/localize/flight_solver.hpp"
#include "flight_support.hpp"

namespace anchord::region_reason_test {
namespace {

using testing::MadeFlight;

std::vector<AnchorSolution> anchors_of(const FlightData& flight, const FlightOptions& options = {}) {
  return solve_flight(flight, options).value().anchors;
}

const Gate& gate(const Estimate& estimate, const std::string& name) {
  return *std::ranges::find(estimate.gates, name, &Gate::name);
}

bool says(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A tag that may hang anywhere within metres of where it is declared; everything else of the flight is good.
FlightData loose_arm(double sigma_m) {
  FlightData flight = testing::make_flight(MadeFlight{});
  flight.mission.lever_arm_sigma_m = sigma_m;
  return flight;
}

TEST(RegionReason, NamesTheLeverArmWhereThatMakesTheRegionTooWide) {
  for (const auto& anchor : anchors_of(loose_arm(3))) {
    const Estimate& e = anchor.estimate;
    ASSERT_FALSE(gate(e, "precision").passed);
    for (const std::string& text : {e.reason, gate(e, "precision").why}) {
      EXPECT_TRUE(says(text, "; the largest part of its uncertainty is the lever arm (")) << text;
      EXPECT_TRUE(says(text, "help most: measure the lever arm")) << text;
    }
  }
}

TEST(RegionReason, NamesTheGeometryOfAFlightAlongALine) {
  MadeFlight line;
  line.height_swing_m = 0.05;
  line.width_m = 0.1;
  for (const auto& anchor : anchors_of(testing::make_flight(line))) {
    ASSERT_EQ(anchor.estimate.verdict, Verdict::weak_geometry);
    const std::string& reason = anchor.estimate.reason;
    EXPECT_TRUE(says(reason, "line")) << reason;
    EXPECT_TRUE(says(reason, "; the largest part of its uncertainty is the geometry of the flight ("))
        << reason;
    EXPECT_TRUE(says(reason, "help most: points ")) << reason;
  }
}

/// The third anchor is at the height of the flight, which hardly shows how high that is: its own delay, which
/// no other anchor tells, moves it far up or down.
TEST(RegionReason, IsThatOfTheAnchorsThatAreTooWideAlone) {
  MadeFlight level;
  level.height_swing_m = 0.7;
  level.anchors = {{12, 2, 5.5}, {-10, 8, 5.6}, {3, -14, 6.3}};
  level.noise_m = 0.5;
  const auto anchors = anchors_of(testing::make_flight(level));
  const Estimate& wide = anchors[2].estimate;
  ASSERT_EQ(wide.verdict, Verdict::ok);
  ASSERT_FALSE(gate(wide, "precision").passed);
  EXPECT_TRUE(
      wide.reason.starts_with("its region of uncertainty is too large for its distance; the largest part of "
                              "its uncertainty is the range bias ("))
      << wide.reason;
  ASSERT_TRUE(gate(anchors[0].estimate, "precision").passed);
  EXPECT_FALSE(says(gate(anchors[0].estimate, "precision").why, "largest part"));
}

TEST(RegionReason, OfAnAnchorOutsideTheAccuracyGoalSaysByHowMuchAndWhy) {
  for (const auto& anchor : anchors_of(loose_arm(0.2))) {
    Estimate estimate = anchor.estimate;
    ASSERT_TRUE(estimate.acceptable());
    ASSERT_TRUE(estimate.reason.empty());
    assess_goal(estimate, {.bounds = {.h95_m = 10, .v95_m = 10}});
    EXPECT_TRUE(estimate.reason.empty()) << "within the goal there is nothing to explain";
    for (int again = 0; again < 2; ++again) {
      assess_goal(estimate, {.bounds = {.h95_m = 0.3, .v95_m = 10}});
      EXPECT_TRUE(estimate.reason.starts_with("not within the accuracy goal: 95 % horizontal 0.5"))
          << estimate.reason;  // 2.45 sigma of 0.2 m, and the floor
      EXPECT_TRUE(
          says(estimate.reason, "(goal 0.30 m); the largest part of its uncertainty is the lever arm"))
          << estimate.reason;
      EXPECT_EQ(estimate.reason.find("largest part"), estimate.reason.rfind("largest part"));
      EXPECT_TRUE(says(gate(estimate, k_goal_h95).why, "measure the lever arm"));
      EXPECT_TRUE(gate(estimate, k_goal_v95).why.empty());
    }
  }
}

/// As where several flights are fused, or the base is known: the later budget holds.
TEST(RegionReason, IsThatOfTheLastBudget) {
  Estimate estimate = anchors_of(loose_arm(3)).front().estimate;
  ErrorBudget base;
  base.part(ErrorSource::base) = 25 * Eigen::Matrix3d::Identity();
  name_largest_part(estimate, base);
  name_largest_part(estimate, base);
  for (const std::string& text : {estimate.reason, gate(estimate, "precision").why, estimate.largest_part}) {
    EXPECT_TRUE(says(text, "is the base station (100 %)")) << text;
    EXPECT_FALSE(says(text, "lever arm")) << text;
    EXPECT_EQ(text.find("largest part"), text.rfind("largest part")) << text;
  }
}

}  // namespace
}  // namespace anchord::region_reason_test
