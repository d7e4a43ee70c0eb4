// What a position's uncertainty comes from: closed forms, sums, and each source alone made the largest.
#include "core/localize/error_budget.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/localize/flight_solver.hpp"
#include "flight_support.hpp"

namespace anchord::error_budget_test {
namespace {

using testing::MadeFlight;

/// One anchor whose x alone is tied to the shared bias; information in 1/m^2.
struct SmallCase {
  JointFit fit;
  SharedPrior prior;
  FlightRows rows;
};

JointFit small_fit(const Eigen::Vector3d& information, double tie, double bias_information,
                   SharedPrior& prior, double delay_information) {
  JointFit fit;
  fit.state.anchors.resize(1);
  auto& block = fit.normal.anchors.emplace_back();
  block.own.diagonal() << information, delay_information;
  block.own_inverse = block.own.inverse();
  block.shared(0, k_shared_bias) = tie;
  block.scale_m = 0.1;
  block.usual_position_variance_m2 = 0.0025;
  fit.normal.shared(k_shared_bias, k_shared_bias) = bias_information;
  prior.information = SharedMatrix::Identity();
  prior.information(k_shared_bias, k_shared_bias) = 50;
  const double left = bias_information + 50 - tie * tie / information.x();
  Eigen::Matrix4d covariance = block.own_inverse;
  covariance(0, 0) += std::pow(tie / information.x(), 2) / left;
  fit.anchor_covariance.push_back(covariance);
  return fit;
}

FlightRows no_rows() {
  return {UtcTime{}, std::nullopt, TagTrack({}, std::nullopt, UtcTime{}, {}), {}, {}, {}, 0};
}

TEST(ErrorBudget, IsTheClosedFormWhereOneAxisIsTiedToTheBias) {
  SharedPrior prior;
  // Isotropic: 0.01 m^2 an axis. The bias: 80 + 50 - 60^2 / 100 = 94; (60 / 100)^2 / 94 goes if it is known.
  const JointFit fit = small_fit({100, 100, 100}, 60, 80, prior, 1e9);
  FlightOptions options;
  const auto budget = error_budgets(no_rows(), fit, prior, options).at(0);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::bias), 0.36 / 94, 1e-7);  // 1e-6 of damping in own_inverse
  EXPECT_NEAR(budget.trace_m2(ErrorSource::clock), 0, 1e-9);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::lever_arm), 0, 1e-9);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::geometry), 0, 1e-8);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::rtk), 0.25 * 0.03, 1e-7);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::ranging), 0.75 * 0.03, 1e-7);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::floor), 3 * 0.04 * 0.04, 1e-12);
  EXPECT_EQ(budget.help(), BudgetHelp::more_points);
}

TEST(ErrorBudget, GivesTheGeometryWhatEvenDirectionsWouldSave) {
  SharedPrior prior;
  // 0.01, 0.01, 0.09 m^2: with the same ranges from everywhere 9 / (100 + 100 + 100 / 9) = 0.04263.
  const JointFit fit = small_fit({100, 100, 100.0 / 9}, 0, 0, prior, 1e9);
  const auto budget = error_budgets(no_rows(), fit, prior, {}).at(0);
  const double even_m2 = 9 / (200 + 100.0 / 9);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::geometry), 0.11 - even_m2, 1e-6);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::ranging), 0.75 * even_m2, 1e-6);
  EXPECT_EQ(budget.largest(), ErrorSource::geometry);
  EXPECT_EQ(budget.help(), BudgetHelp::other_height);
}

TEST(ErrorBudget, AddsTheDoubtAboutTheBiasToTheBias) {
  SharedPrior prior;
  JointFit fit = small_fit({100, 100, 100}, 0, 0, prior, 1e9);
  fit.anchor_covariance[0](1, 1) += 0.02;
  const auto budget = error_budgets(no_rows(), fit, prior, {}).at(0);
  EXPECT_NEAR(budget.trace_m2(ErrorSource::bias), 0.02, 1e-7);
}

TEST(ErrorBudget, OfTwoFlightsIsThroughTheGainOfTheirMean) {
  // Variances 1 and 3 in every axis: weights 3/4 and 1/4, so the parts count 9/16 and 1/16.
  ErrorBudget first, second;
  first.part(ErrorSource::bias) = Eigen::Matrix3d::Identity();
  second.part(ErrorSource::clock) = 3 * Eigen::Matrix3d::Identity();
  const std::vector<BudgetOf> both{{&first, Eigen::Matrix3d::Identity()},
                                   {&second, 3 * Eigen::Matrix3d::Identity()}};
  const auto plain = fused_budget(both, 0.75 * Eigen::Matrix3d::Identity());
  EXPECT_NEAR(plain.trace_m2(ErrorSource::bias), 3 * 9.0 / 16, 1e-12);
  EXPECT_NEAR(plain.trace_m2(ErrorSource::clock), 3 * 3.0 / 16, 1e-12);
  const auto wider = fused_budget(both, 1.5 * Eigen::Matrix3d::Identity());
  EXPECT_NEAR(wider.trace_m2(), 4.5, 1e-12);
}

FlightSolution solved(const MadeFlight& m, const FlightOptions& options = {}) {
  auto solution = solve_flight(testing::make_flight(m), options);
  EXPECT_TRUE(solution.has_value());
  return std::move(solution).value();
}

void expect_sums(const FlightSolution& solution) {
  for (const auto& anchor : solution.anchors) {
    ASSERT_TRUE(anchor.budget.has_value());
    const double whole_m2 = anchor.estimate.best->covariance_m2.trace();
    EXPECT_NEAR(anchor.budget->trace_m2(), whole_m2, 1e-6 * whole_m2);
    for (std::size_t i = 0; i < k_error_sources; ++i)
      EXPECT_GE(anchor.budget->trace_m2(static_cast<ErrorSource>(i)), -1e-6 * whole_m2) << i;
  }
}

TEST(ErrorBudget, SumsToTheCovarianceClaimed) {
  MadeFlight m;
  expect_sums(solved(m));
  m.bias_m = 0.4;
  m.pairs = true;  // no longer an arrow
  expect_sums(solved(m));
  FlightOptions plane;
  plane.dims = Dims::two;
  expect_sums(solved(MadeFlight{}, plane));
}

/// Source with the largest share, summed over the anchors.
ErrorSource largest(const FlightSolution& solution) {
  ErrorBudget all;
  for (const auto& anchor : solution.anchors) {
    for (std::size_t i = 0; anchor.budget && i < k_error_sources; ++i)
      all.parts_m2[i] += anchor.budget->parts_m2[i] / anchor.budget->trace_m2();
  }
  std::string shares;
  for (std::size_t i = 0; i < k_error_sources; ++i)
    shares += std::string(k_error_source_words.word(static_cast<ErrorSource>(i))) + ' ' +
              std::to_string(all.share(static_cast<ErrorSource>(i))) + "  ";
  std::printf("%s\n", shares.c_str());
  return all.largest();
}

/// As high as it is wide, so that no direction is weak.
MadeFlight round_scene() {
  MadeFlight m;
  m.height_swing_m = 15;
  return m;
}

TEST(ErrorBudget, NamesNoiseOfTheRanges) {
  MadeFlight m = round_scene();
  m.noise_m = 1.5;
  EXPECT_EQ(largest(solved(m)), ErrorSource::ranging);
}

TEST(ErrorBudget, NamesABiasNobodyKnows) {
  MadeFlight m = round_scene();
  // All on one side: a bias moves them away and nothing else does.
  m.anchors = {{60, 2, 3}, {62, 10, 6}, {58, -8, 2}, {61, -3, 9}};
  FlightOptions options;
  options.bias_gate_z = 0;  // no kit is treated as calibrated
  EXPECT_EQ(largest(solved(m, options)), ErrorSource::bias);
}

TEST(ErrorBudget, NamesTheRtk) {
  FlightData flight = testing::make_flight(round_scene());
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1);
  for (auto& fix : flight.fixes) {
    fix.local_m += 0.8 * Eigen::Vector3d(noise(random), noise(random), noise(random));
    fix.covariance_m2 = 0.64 * Eigen::Matrix3d::Identity();
  }
  FlightOptions options;
  options.track.max_acceleration_mps2 = 1e6;
  options.track.max_speed_mps = 1e6;
  const auto solution = solve_flight(flight, options);
  ASSERT_TRUE(solution.has_value());
  EXPECT_EQ(largest(solution.value()), ErrorSource::rtk);
}

TEST(ErrorBudget, NamesTheLeverArm) {
  FlightOptions options;
  options.lever_prior_m = 0.5;
  EXPECT_EQ(largest(solved(MadeFlight{}, options)), ErrorSource::lever_arm);
}

/// Flown once round at constant speed while climbing steadily: a lag looks like a turn of all anchors.
TEST(ErrorBudget, NamesTheClock) {
  const MadeFlight m;
  FlightData flight = testing::make_flight(m);
  const auto helix = [](double t_s) {
    return Eigen::Vector3d(18 * std::cos(0.2 * t_s), 18 * std::sin(0.2 * t_s), 0.1 * t_s);
  };
  for (auto& fix : flight.fixes) fix.local_m = helix(fix.time.seconds());
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise(0, 0.05);
  for (auto& range : flight.ranges) {
    const auto a = range.anchor.value - 0x6000;
    range.distance_m = (helix(range.time.seconds()) - m.anchors[a]).norm() + noise(random);
  }
  const auto solution = solve_flight(flight);
  ASSERT_TRUE(solution.has_value());
  EXPECT_EQ(largest(solution.value()), ErrorSource::clock);
}

TEST(ErrorBudget, NamesTheGeometry) {
  MadeFlight m;
  m.height_swing_m = 0.4;
  m.anchors = {{12, 2, 4.5}, {-10, 8, 6.5}, {3, -14, 5}, {-6, -9, 7}};
  FlightOptions options;
  options.lever_prior_m = 0.01;  // else the height of the antenna is as weak, and so is the bias
  options.fixed_bias_m = 0;
  options.delay_prior_m = 0.005;
  const auto solution = solved(m, options);
  EXPECT_EQ(largest(solution), ErrorSource::geometry);
}

TEST(ErrorBudget, NamesTheFloor) {
  FlightOptions options;
  options.floor_sigma_m = 1;
  EXPECT_EQ(largest(solved(MadeFlight{}, options)), ErrorSource::floor);
}

}  // namespace
}  // namespace anchord::error_budget_test
