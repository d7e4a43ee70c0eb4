#include "core/localize/flight_history.hpp"

#include <gtest/gtest.h>

#include "core/localize/accuracy_goal.hpp"

namespace anchord::flight_history_test {
namespace {

TEST(FlightHistory, StaysWithinItsBoundAndKeepsOldAndNewAlike) {
  FlightHistory history;
  const int n = 100'000;
  for (int i = 0; i < n; ++i) {
    Range range;
    range.time = UtcTime::from_seconds(i);
    history.add(range);
    Fix fix;
    fix.time = UtcTime::from_seconds(i);
    history.add(fix);
  }
  const auto kept = history.data(Mission{});
  EXPECT_LT(kept.ranges.size(), FlightHistory::k_max_ranges);
  EXPECT_LT(kept.fixes.size(), FlightHistory::k_max_fixes);
  EXPECT_EQ(kept.ranges.front().time, UtcTime::from_seconds(0));
  const double gap_s = kept.ranges[1].time.seconds() - kept.ranges[0].time.seconds();
  for (std::size_t i = 1; i < kept.ranges.size(); ++i)
    EXPECT_NEAR(seconds_between(kept.ranges[i - 1].time, kept.ranges[i].time), gap_s, 1e-6);
  EXPECT_LE(n - kept.ranges.back().time.seconds(), 2 * gap_s);
  EXPECT_EQ(history.newest(), kept.ranges.back().time);
}

TEST(FlightHistory, KeepsEachErrorModelWithItsRange) {
  FlightHistory history;
  const int n = 60'000;
  for (int i = 0; i < n; ++i) {
    Range range;
    range.time = UtcTime::from_seconds(i);
    RangeErrorModel error_model;
    error_model.p_los = static_cast<double>(i) / n;
    // The first hundred came before a model was promoted.
    history.add(range, i < 100 ? std::nullopt : std::optional(error_model));
  }
  const auto kept = history.data(Mission{});
  ASSERT_EQ(kept.error_models.size(), kept.ranges.size());
  for (std::size_t i = 0; i < kept.ranges.size(); ++i) {
    const double t_s = kept.ranges[i].time.seconds();
    ASSERT_EQ(kept.error_models[i].has_value(), t_s >= 100) << t_s;
    if (t_s >= 100) {
      EXPECT_NEAR(kept.error_models[i]->p_los, t_s / n, 1e-9);
    }
  }
}

TEST(FlightHistory, KeepsNoImpulseResponses) {
  FlightHistory history;
  Range range;
  range.cir.emplace();
  history.add(range);
  EXPECT_FALSE(history.data(Mission{}).ranges[0].cir);
}

Estimate known_within(double h95_m, double v95_m) {
  Estimate estimate;
  estimate.verdict = Verdict::ok;
  estimate.best = Hypothesis{};
  estimate.h95_m = h95_m;
  estimate.v95_m = v95_m;
  Gate gate;
  gate.name = "residuals";
  gate.passed = true;
  estimate.gates = {gate};
  return estimate;
}

AnchorGoal bounds(double h95_m, double v95_m) { return {.bounds = {h95_m, v95_m}}; }

TEST(AccuracyGoal, IsTheAnchorsOwnTargetThenThePlansThenTheSites) {
  const NetworkId own{1}, other{2};
  const AccuracyGoal site{.h95_m = 0.3, .v95_m = 0.6};
  const std::vector<PlanTargets> flown{{.sigma_m = 0.05}, {.sigma_m = 0.1, .of_anchor = {{own, 3}}}};
  EXPECT_EQ(anchor_goal(own, flown, site), (AnchorGoal{GoalSource::anchor_target, 3, site}))
      << "of an older flight, before the plan of the newest";
  EXPECT_EQ(anchor_goal(other, flown, site), (AnchorGoal{GoalSource::plan_target, 0.05, site}));
  EXPECT_EQ(anchor_goal(own, std::vector<PlanTargets>{{}}, site), (AnchorGoal{GoalSource::site, {}, site}));
  EXPECT_EQ(anchor_goal(own, {}, {}).source, GoalSource::standard);
}

TEST(AccuracyGoal, OfATargetIsTheSigmaOfThePositionAloneWhateverTheSiteWants) {
  auto estimate = known_within(5, 5);
  estimate.best->covariance_m2 = Eigen::Vector3d(4, 3, 2).asDiagonal();  // trace 9
  assess_goal(estimate, {GoalSource::anchor_target, 3, {}});
  ASSERT_EQ(estimate.gates.size(), 2U);
  EXPECT_EQ(estimate.gates[1].name, "target_sigma_m");
  EXPECT_EQ(estimate.gates[1].value, 3.0);
  EXPECT_TRUE(reached_goal(estimate));
  assess_goal(estimate, {GoalSource::plan_target, 2.999, {}});
  EXPECT_FALSE(reached_goal(estimate));
}

TEST(AccuracyGoal, IsReachedOnlyWhenBothBoundsAreWithinIt) {
  for (const auto& [h95_m, v95_m, reached] :
       {std::tuple{0.2, 0.4, true}, {0.201, 0.1, false}, {0.1, 0.401, false}, {0.05, 0.05, true}}) {
    auto estimate = known_within(h95_m, v95_m);
    assess_goal(estimate, bounds(0.2, 0.4));
    EXPECT_EQ(reached_goal(estimate), reached) << h95_m << ' ' << v95_m;
  }
}

TEST(AccuracyGoal, IsJudgedAnewNotTwice) {
  auto estimate = known_within(0.3, 0.3);
  assess_goal(estimate, bounds(0.2, 0.4));
  EXPECT_FALSE(reached_goal(estimate));
  assess_goal(estimate, bounds(0.5, 0.5));
  EXPECT_EQ(estimate.gates.size(), 3U);
  EXPECT_TRUE(reached_goal(estimate));
}

TEST(AccuracyGoal, IsNotReachedWhereAGateHoldsTheAnchorBackOrNoneWasAsked) {
  auto held_back = known_within(0.01, 0.01);
  held_back.gates[0].passed = false;
  assess_goal(held_back, {});
  EXPECT_FALSE(reached_goal(held_back));
  auto not_asked = known_within(0.01, 0.01);
  not_asked.gates.clear();
  assess_goal(not_asked, {});
  EXPECT_FALSE(reached_goal(not_asked));
}

TEST(AccuracyGoal, IsNotReachedWithoutAPositionOrWithAnotherVerdict) {
  Estimate nowhere;
  assess_goal(nowhere, {});
  EXPECT_FALSE(reached_goal(nowhere));
  auto ambiguous = known_within(0.01, 0.01);
  ambiguous.verdict = Verdict::ambiguous;
  assess_goal(ambiguous, {});
  EXPECT_FALSE(reached_goal(ambiguous));
  EXPECT_FALSE(reached_goal(known_within(0.01, 0.01))) << "never judged";
}

}  // namespace
}  // namespace anchord::flight_history_test
