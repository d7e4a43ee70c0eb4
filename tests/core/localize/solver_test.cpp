#include "core/localize/solver.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/localize/joint_model.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/residual.hpp"
#include "tests/core/localize/support.hpp"

namespace anchord::solver_test {
namespace {

const std::vector<Method> k_methods{Method::gauss_newton, Method::levenberg_marquardt, Method::dogleg};

TEST(AnchorSolver, IsBelowAMillimetreForExactRangesByEveryMethod) {
  std::mt19937_64 random(5);
  const Eigen::Vector3d anchor(30, -200, 12);
  const auto rows = testing::ranges_from_box(random, anchor, 40, {20, 20, 10}, 1e-9);
  for (const Method method : k_methods) {
    SolverOptions options;
    options.method = method;
    const auto fit = solve_anchor(rows, linear_position(rows).value() + Eigen::Vector3d(3, 3, -2), options);
    ASSERT_TRUE(fit) << fit.error().message;
    EXPECT_LT((fit.value().position_m - anchor).norm(), 1e-3);
  }
}

TEST(AnchorSolver, AgreesWithIndependentGaussNewtonOnAThousandCases) {
  std::mt19937_64 random(20240101);
  std::uniform_real_distribution<double> side(-1, 1);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d anchor(15 * side(random), 15 * side(random), 8 * side(random));
    auto rows =
        testing::ranges_from_box(random, anchor, 12 + static_cast<std::size_t>(i % 40), {20, 20, 10}, 0.05);
    for (auto& o : rows) o.tag_covariance_m2 = Eigen::Vector3d(400e-6, 400e-6, 900e-6).asDiagonal();
    SolverOptions options;
    options.method = k_methods[static_cast<std::size_t>(i) % 3];
    options.dims = i % 5 == 0 ? Dims::two : Dims::three;
    options.weights = i % 7 == 0 ? Weights::as_printed : Weights::inverse_variance;
    options.loss = i % 4 == 1 ? Loss::huber : Loss::none;
    options.estimate_bias = i % 6 == 2;
    const Eigen::Vector3d start = anchor + Eigen::Vector3d(0.5, -0.4, options.dims == Dims::two ? 0.0 : 0.3);
    const auto ceres = solve_anchor(rows, start, options);
    const auto eigen = solve_anchor_gauss_newton(rows, start, options);
    ASSERT_TRUE(ceres) << i << " " << ceres.error().message;
    ASSERT_TRUE(eigen) << i << " " << eigen.error().message;
    ASSERT_LT((ceres.value().position_m - eigen.value().position_m).norm(), 1e-6) << "case " << i;
    ASSERT_LT((ceres.value().covariance_m2 - eigen.value().covariance_m2).norm(), 1e-6) << "case " << i;
  }
}

TEST(AnchorSolver, JacobianMatchesFiniteDifferences) {
  std::mt19937_64 random(3);
  const auto rows = testing::ranges_from_box(random, {4, 5, 6}, 20, {10, 10, 10}, 0.3);
  const Unknowns at(3.5, 5.2, 5.0, 0.1);
  const auto scales = row_scales(rows, at, Weights::inverse_variance);
  for (const Loss loss : {Loss::none, Loss::huber, Loss::cauchy, Loss::tukey}) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      Eigen::Vector4d analytic;
      robust_residual(rows[i], scales[i], at, loss, default_bend(loss), &analytic);
      for (int k = 0; k < 4; ++k) {
        Unknowns up = at;
        Unknowns down = at;
        up[k] += 1e-6;
        down[k] -= 1e-6;
        const double numeric =
            (robust_residual(rows[i], scales[i], up, loss, default_bend(loss), nullptr) -
             robust_residual(rows[i], scales[i], down, loss, default_bend(loss), nullptr)) /
            2e-6;
        EXPECT_NEAR(analytic[k], numeric, 1e-5) << "row " << i << " unknown " << k;
      }
    }
  }
}

TEST(JointModel, JacobianMatchesFiniteDifferences) {
  std::vector<Fix> fixes;
  for (int i = 0; i < 50; ++i) {
    Fix fix;
    fix.time = UtcTime::from_seconds(0.1 * i);
    fix.frame = TrackFrame::local;
    fix.local_m = {0.2 * i, std::sin(0.3 * i), 0.05 * i};
    fix.fix = FixClass::rtk_fixed;
    fix.enu_from_body = Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d(0.1, 0.2, 1).normalized()));
    fixes.push_back(fix);
  }
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  JointRow row{2.03, 9.0, {0.2, -0.4, 0.1}};
  row.arm = 1;
  JointState::Anchor anchor{{-6, 5, 2}, 0.02, true};
  const SharedVector shared{{0.3, 0.05, 0.012, 0.04, 0.03, -0.05, 0.01, 0.02, -0.03, 0.04}};
  const JointLine line = linearise(track, row, shared, anchor);
  const double h = 1e-7;
  for (int k = 0; k < k_shared_size; ++k) {
    SharedVector up = shared;
    SharedVector down = shared;
    up[k] += h;
    down[k] -= h;
    const double numeric =
        -(linearise(track, row, up, anchor).residual_m - linearise(track, row, down, anchor).residual_m) /
        (2 * h);
    EXPECT_NEAR(line.by_shared[k], numeric, 1e-5) << "shared " << k;
  }
  for (int k = 0; k < 4; ++k) {
    auto moved = [&](double step) {
      JointState::Anchor a = anchor;
      if (k < 3) {
        a.position_m[k] += step;
      } else {
        a.delay_m += step;
      }
      return linearise(track, row, shared, a).residual_m;
    };
    EXPECT_NEAR(line.by_anchor[k], -(moved(h) - moved(-h)) / (2 * h), 1e-5) << "anchor " << k;
  }
}

TEST(AnchorSolver, EllipsoidHoldsTruthIn95PercentOfRuns) {
  // Dissertation 7.2.3: LOS 2401 mm^2, NLOS 54550 mm^2, RTK 400 mm^2 per axis. 7.815: chi-square 95 %, three
  // degrees.
  std::mt19937_64 random(77);
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> side(-1, 1);
  int inside = 0;
  constexpr int k_runs = 2000;
  for (int run = 0; run < k_runs; ++run) {
    const Eigen::Vector3d anchor(8 * side(random), 8 * side(random), 2 * side(random));
    std::vector<Observation> rows;
    for (int i = 0; i < 40; ++i) {
      Observation o;
      const Eigen::Vector3d truth(20 * side(random), 20 * side(random), 10 * side(random));
      o.tag_m =
          truth + std::sqrt(k_variance_rtk_m2) * Eigen::Vector3d(noise(random), noise(random), noise(random));
      o.tag_covariance_m2 = Eigen::Matrix3d::Identity() * k_variance_rtk_m2;
      o.sigma_m = std::sqrt(i % 3 == 0 ? k_variance_nlos_m2 : k_variance_los_m2);
      o.distance_m = (truth - anchor).norm() + o.sigma_m * noise(random);
      rows.push_back(o);
    }
    const auto fit = solve_anchor_gauss_newton(rows, linear_position(rows).value());
    ASSERT_TRUE(fit);
    const Eigen::Vector3d error = fit.value().position_m - anchor;
    if (error.dot(fit.value().covariance_m2.inverse() * error) < 7.815) ++inside;
  }
  EXPECT_GE(inside, k_runs * 93 / 100);
  EXPECT_LE(inside, k_runs * 97 / 100);
}

TEST(AnchorSolver, WeighsLineOfSightMoreLikeFigure72) {
  // Section 7.2.3 and Fig 7.2: four good ranges and one obstructed, 0.5 m long; weights pull the answer to
  // the good ones.
  std::vector<Observation> rows;
  const Eigen::Vector3d anchor(0, 0, 0);
  for (const auto& p : {Eigen::Vector3d(5, 0, 0), Eigen::Vector3d(-4, 3, 0), Eigen::Vector3d(-1, -6, 0),
                        Eigen::Vector3d(3, 5, 0), Eigen::Vector3d(0, 7, 0)}) {
    Observation o;
    o.tag_m = p;
    o.distance_m = (p - anchor).norm();
    o.sigma_m = std::sqrt(k_variance_los_m2);
    o.tag_covariance_m2 = Eigen::Matrix3d::Identity() * k_variance_rtk_m2;
    rows.push_back(o);
  }
  rows.back().distance_m += 0.5;
  SolverOptions options;
  options.dims = Dims::two;
  const double equal_m = solve_anchor(rows, {0.5, 0.5, 0}, options).value().position_m.norm();
  rows.back().sigma_m = std::sqrt(k_variance_nlos_m2);
  const double weighted_m = solve_anchor(rows, {0.5, 0.5, 0}, options).value().position_m.norm();
  options.weights = Weights::as_printed;
  const double printed_m = solve_anchor(rows, {0.5, 0.5, 0}, options).value().position_m.norm();
  EXPECT_LT(weighted_m, 0.2 * equal_m);
  EXPECT_LT(weighted_m, printed_m);  // eq 7.11 weighs by 1/sigma: less of the same
  EXPECT_LT(printed_m, equal_m);
}

TEST(AnchorSolver, ProjectsTheRtkVarianceOnTheLineOfSight) {
  Observation o;
  o.tag_m = {10, 0, 0};
  o.sigma_m = 0.03;
  o.tag_covariance_m2 = Eigen::Vector3d(0.04 * 0.04, 1.0, 1.0).asDiagonal();
  const std::vector<Observation> rows{o};
  // The anchor is due west: only the eastward variance counts. 3-4-5 triangle.
  EXPECT_NEAR(row_scales(rows, Unknowns(0, 0, 0, 0), Weights::inverse_variance)[0].sigma_m, 0.05, 1e-12);
}

TEST(AnchorSolver, RecoversAnchorUnderThirtyPercentNlosOutliers) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> excess(0.5, 3);
  const Eigen::Vector3d anchor(4, -6, 2);
  auto rows = testing::ranges_from_box(random, anchor, 200, {15, 15, 8}, 0.05);
  for (std::size_t i = 0; i < rows.size(); i += 10) {
    for (std::size_t k = i; k < i + 3; ++k) rows[k].distance_m += excess(random);
  }
  SolverOptions options;
  options.loss = Loss::tukey;
  const auto start =
      solve_anchor(rows, linear_position(rows).value(), {.loss = Loss::cauchy}).value().position_m;
  EXPECT_LT((solve_anchor(rows, start, options).value().position_m - anchor).norm(), 0.05);
}

TEST(AnchorSolver, FindsAConstantBiasWhenAsked) {
  std::mt19937_64 random(13);
  const Eigen::Vector3d anchor(1, 2, 3);
  auto rows = testing::ranges_from_box(random, anchor, 200, {15, 15, 8}, 0.02);
  for (auto& o : rows) o.distance_m += 0.25;
  SolverOptions options;
  options.estimate_bias = true;
  const auto fit = solve_anchor(rows, {0, 0, 0}, options);
  ASSERT_TRUE(fit);
  EXPECT_NEAR(fit.value().bias_m, 0.25, 4 * *fit.value().bias_sigma_m);
  EXPECT_LT((fit.value().position_m - anchor).norm(), 0.02);
}

TEST(AnchorSolver, HoldsTheHeightInTwoDimensions) {
  std::mt19937_64 random(17);
  const auto rows = testing::ranges_from_box(random, {3, 4, 2.5}, 30, {15, 15, 0.5}, 0.01);
  const auto fit = solve_anchor(rows, {0, 0, 2.5}, {.dims = Dims::two});
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit.value().position_m.z(), 2.5);
  EXPECT_LT((fit.value().position_m - Eigen::Vector3d(3, 4, 2.5)).norm(), 0.02);
}

TEST(AnchorSolver, AnswersBadInputInsteadOfAborting) {
  std::mt19937_64 random(19);
  auto rows = testing::ranges_from_box(random, {1, 2, 3}, 10, {5, 5, 5}, 0.01);
  for (const auto solve : {&solve_anchor, &solve_anchor_gauss_newton}) {
    EXPECT_EQ(solve(std::span(rows).first(3), {0, 0, 0}, {}).error().code, Errc::too_few_observations);
    EXPECT_EQ(solve({}, {0, 0, 0}, {}).error().code, Errc::too_few_observations);
    EXPECT_EQ(solve(rows, {std::nan(""), 0, 0}, {}).error().code, Errc::invalid_argument);
    auto broken = rows;
    broken[4].distance_m = std::nan("");
    EXPECT_EQ(solve(broken, {0, 0, 0}, {}).error().code, Errc::invalid_argument);
    broken = rows;
    broken[4].sigma_m = 0;
    EXPECT_EQ(solve(broken, {0, 0, 0}, {}).error().code, Errc::invalid_argument);
    const std::vector<Observation> same(20, rows[0]);
    EXPECT_FALSE(solve(same, {0, 0, 0}, {}));
  }
}

TEST(AnchorSolver, ToleratesStartingOnATagPosition) {
  std::mt19937_64 random(23);
  const auto rows = testing::ranges_from_box(random, {1, 2, 3}, 20, {5, 5, 5}, 0.01);
  const auto fit = solve_anchor(rows, rows[3].tag_m, {});
  ASSERT_TRUE(fit);
  EXPECT_LT((fit.value().position_m - Eigen::Vector3d(1, 2, 3)).norm(), 0.05);
}

}  // namespace
}  // namespace anchord::solver_test
