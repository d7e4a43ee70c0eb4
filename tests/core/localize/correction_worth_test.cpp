// Corrections must show on the flight itself that they are worth something.
#include "core/localize/correction_worth.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "flight_support.hpp"

namespace anchord::correction_worth_test {
namespace {

using testing::MadeFlight;

FlightSolution solved(const FlightData& flight) {
  auto solution = solve_flight(flight);
  EXPECT_TRUE(solution.has_value());
  return std::move(solution).value();
}

/// Half of the ranges late by what a model may know; what it takes off is `share` of that.
struct Pair {
  FlightData raw, corrected;
};
Pair flight_with_known_delays(double share, double misled_m) {
  MadeFlight m;
  FlightData raw = testing::make_flight(m);
  FlightData corrected = raw;
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> noise(0, 1);
  for (std::size_t i = 0; i < raw.ranges.size(); ++i) {
    const double late_m = share > 0 && uniform(random) < 0.5 ? 0.25 * uniform(random) : 0.0;
    raw.ranges[i].distance_m += late_m;
    corrected.ranges[i].distance_m = raw.ranges[i].distance_m - share * late_m - misled_m * noise(random);
  }
  return {std::move(raw), std::move(corrected)};
}

TEST(CorrectionWorth, IsShownByCorrectionsThatTakeErrorsOff) {
  const auto both = flight_with_known_delays(0.9, 0);
  const auto worth = correction_worth(solved(both.raw), solved(both.corrected), both.corrected);
  EXPECT_TRUE(worth.shown) << worth.text();
  EXPECT_GT(worth.gain, 0.1);
}

TEST(CorrectionWorth, IsNotShownByCorrectionsThatAddErrors) {
  const auto both = flight_with_known_delays(0, 0.1);
  const auto worth = correction_worth(solved(both.raw), solved(both.corrected), both.corrected);
  EXPECT_FALSE(worth.shown) << worth.text();
  // Gaussian noise of 0.05 m becomes 0.112 m: ln(0.112 / 0.05) = 0.8 worse, were the likelihood Gaussian.
  EXPECT_NEAR(worth.gain, -0.8, 0.15);
}

TEST(CorrectionWorth, IsNotShownByACorrectionThatIsAlikeForAllRanges) {
  const FlightData raw = testing::make_flight(MadeFlight{});
  FlightData shifted = raw;
  for (auto& range : shifted.ranges) range.distance_m -= 0.01;
  const auto worth = correction_worth(solved(raw), solved(shifted), shifted);
  EXPECT_FALSE(worth.shown) << worth.text();
  EXPECT_NEAR(worth.gain, 0, 0.02);
}

TEST(CorrectionWorth, IsNotShownByErrorModelsThatAreWrong) {
  const FlightData raw = testing::make_flight(MadeFlight{});
  FlightData believed = raw;
  // Half a metre late in half of the cases, says the model; none is.
  believed.error_models.assign(raw.ranges.size(), RangeErrorModel{0.5, 0, 0.3, 0.5, 0.3, 0.5});
  const auto worth = correction_worth(solved(raw), solved(believed), believed);
  EXPECT_FALSE(worth.shown) << worth.text();
}

TEST(CorrectionWorth, IsNotShownByAHandfulOfRanges) {
  FlightData raw = testing::make_flight(MadeFlight{});
  const FlightSolution solution = solved(raw);
  FlightSolution few = solution;
  for (auto& anchor : few.anchors) anchor.residuals.resize(20);
  EXPECT_FALSE(correction_worth(solution, few, raw).shown);
}

TEST(CorrectionWorth, HasTheClosedFormOfStudentsT) {
  // Residuals of +-1 without, +-0.5 with: every density doubles, whatever its shape: ln 2.
  FlightSolution raw, corrected;
  auto& before = raw.anchors.emplace_back();
  for (int i = 0; i < 400; ++i) {
    RangeResidual r;
    r.time = UtcTime::from_seconds(i);
    r.residual_m = i % 2 == 0 ? 1 : -1;
    before.residuals.push_back(r);
  }
  corrected = raw;
  for (auto& r : corrected.anchors[0].residuals) r.residual_m *= 0.5;
  const auto worth = correction_worth(raw, corrected, FlightData{});
  EXPECT_NEAR(worth.gain, std::log(2.0), 1e-6);
  EXPECT_EQ(worth.n_ranges, 400u);
  EXPECT_TRUE(worth.shown);
}

}  // namespace
}  // namespace anchord::correction_worth_test
