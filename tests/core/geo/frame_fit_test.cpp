#include "core/geo/frame_fit.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace anchord::frame_fit_test {
namespace {

using Eigen::Vector3d;

std::vector<FramePair> pairs_of(const std::vector<Vector3d>& local, const FrameTransform& truth) {
  std::vector<FramePair> out;
  for (const auto& at : local) out.push_back({"p" + std::to_string(out.size()), at, truth.enu_from(at), {}});
  return out;
}

const std::vector<Vector3d> k_hall{{0, 0, 2.5}, {30, 0, 3.0}, {30, 20, 2.8}, {0, 20, 2.0}, {14, 9, 4.5}};

FrameTransform turned(FrameModel model, double yaw_deg, double roll_deg, double scale) {
  FrameTransform t;
  t.model = model;
  t.scale = scale;
  t.enu_from_local = (Eigen::AngleAxisd(yaw_deg * std::numbers::pi / 180, Vector3d::UnitZ()) *
                      Eigen::AngleAxisd(roll_deg * std::numbers::pi / 180, Vector3d::UnitX()))
                         .toRotationMatrix();
  t.shift_m = {120.5, -43.25, 12.125};
  return t;
}

TEST(FrameFit, GivesThePublishedExampleOfUmeyama) {
  // Umeyama, IEEE TPAMI 13(4), 1991, section IV: three plane points whose best orthogonal match is a
  // reflection; the best rotation has R = [0.832 0.555; -0.555 0.832], t = (-0.800, 0.400), c = 0.721.
  // Mean square by hand: var_y - (c var_x)^2 / var_x = 10/9 - 0.801^2 / (10/9) = 0.533.
  const std::vector<FramePair> pairs{
      {"a", {0, 0, 0}, {0, 0, 0}, {}}, {"b", {1, 0, 0}, {-1, 0, 0}, {}}, {"c", {0, 2, 0}, {0, 2, 0}, {}}};
  const auto fit = fit_frame(pairs, {.model = FrameModel::four});
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_NEAR(fit.value().transform.enu_from_local(0, 0), 0.832, 5e-4);
  EXPECT_NEAR(fit.value().transform.enu_from_local(0, 1), 0.555, 5e-4);
  EXPECT_NEAR(fit.value().transform.scale, 0.721, 5e-4);
  EXPECT_NEAR(fit.value().transform.shift_m.x(), -0.800, 5e-4);
  EXPECT_NEAR(fit.value().transform.shift_m.y(), 0.400, 5e-4);
  EXPECT_NEAR(fit.value().rms_m * fit.value().rms_m, 0.5333, 5e-4);
  ASSERT_FALSE(fit.value().notes.empty());
  EXPECT_NE(fit.value().notes.front().find("left-handed"), std::string::npos) << fit.value().notes.front();
}

TEST(FrameFit, BringsBackAKnownSevenParameterTransform) {
  const auto truth = turned(FrameModel::seven, 137, 4, 1.0021);
  const auto fit = fit_frame(pairs_of(k_hall, truth));
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_LT((fit.value().transform.enu_from_local - truth.enu_from_local).norm(), 1e-12);
  EXPECT_NEAR(fit.value().transform.scale, 1.0021, 1e-12);
  EXPECT_LT(fit.value().rms_m, 1e-9);
  EXPECT_NEAR(fit.value().transform.yaw_deg(), 137, 1e-9);
  EXPECT_NEAR(fit.value().transform.tilt_deg(), 4, 1e-6);
  const Vector3d anywhere(3, 4, 5);
  EXPECT_LT((fit.value().transform.local_from(truth.enu_from(anywhere)) - anywhere).norm(), 1e-9);
}

TEST(FrameFit, BringsBackAKnownFourParameterTransformWithItsHeightShift) {
  const auto truth = turned(FrameModel::four, -65, 0, 0.998);
  const auto fit = fit_frame(pairs_of(k_hall, truth), {.model = FrameModel::four});
  ASSERT_TRUE(fit.has_value());
  EXPECT_NEAR(fit.value().transform.yaw_deg(), -65, 1e-9);
  EXPECT_NEAR(fit.value().transform.scale, 0.998, 1e-12);
  EXPECT_LT((fit.value().transform.shift_m - truth.shift_m).norm(), 1e-9);
  // Heights shift and are not scaled.
  EXPECT_NEAR(fit.value().transform.enu_from({0, 0, 10}).z() - fit.value().transform.enu_from({0, 0, 0}).z(),
              10, 1e-12);
}

TEST(FrameFit, AgreesWithEigensUmeyamaOnNoisyPairs) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, 0.03);
  auto pairs = pairs_of(k_hall, turned(FrameModel::seven, 20, -3, 1.0));
  Eigen::Matrix3Xd local(3, 5), enu(3, 5);
  for (int i = 0; i < 5; ++i) {
    auto& pair = pairs[static_cast<std::size_t>(i)];
    pair.enu_m += Vector3d(noise(random), noise(random), noise(random));
    local.col(i) = pair.local_m;
    enu.col(i) = pair.enu_m;
  }
  const Eigen::Matrix4d expected = Eigen::umeyama(local, enu, true);
  const auto fit = fit_frame(pairs);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT(
      (fit.value().transform.scale * fit.value().transform.enu_from_local - expected.topLeftCorner<3, 3>())
          .norm(),
      1e-12);
  EXPECT_LT((fit.value().transform.shift_m - expected.topRightCorner<3, 1>()).norm(), 1e-9);
}

TEST(FrameFit, ClaimsACovarianceThatTheSpreadOfManyFitsConfirms) {
  // 2000 seeded fits: the claimed variance of a point outside the pairs against the observed one.
  for (const auto model : {FrameModel::four, FrameModel::seven}) {
    std::mt19937 random(11);
    std::normal_distribution<double> noise(0, 0.05);
    const auto truth = turned(model, 33, 0, 1.0);
    const auto exact = pairs_of(k_hall, truth);
    const Vector3d probe(40, -10, 3);
    Eigen::Matrix3d claimed = Eigen::Matrix3d::Zero(), seen = Eigen::Matrix3d::Zero();
    constexpr int k_runs = 2000;
    for (int run = 0; run < k_runs; ++run) {
      auto pairs = exact;
      for (auto& pair : pairs) pair.enu_m += Vector3d(noise(random), noise(random), noise(random));
      const auto fit = fit_frame(pairs, {.model = model});
      ASSERT_TRUE(fit.has_value());
      const Vector3d off = fit.value().transform.enu_from(probe) - truth.enu_from(probe);
      claimed += fit.value().covariance_at(probe) / k_runs;
      seen += off * off.transpose() / k_runs;
    }
    // The chi-square spread of 2000 runs is 3 %; 10 % would be a wrong Jacobian.
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(seen(axis, axis) / claimed(axis, axis), 1.0, 0.10) << axis;
  }
}

TEST(FrameFit, AddsWhatItIsUncertainToAPlaceToldOnTheGlobe) {
  // Four corners of a square of 20 m, each known to sigma: by hand, with r^2 = 200 m^2 each and the place
  // 50 m from the middle, the shift has sigma^2/4, turn and scale sigma^2 / 800 each, so that the place has
  // sigma^2 (1/4 + 2500/800) along either horizontal axis and sigma^2/4 upwards.
  constexpr double sigma_m = 0.08;
  const auto truth = turned(FrameModel::four, 30, 0, 1.0);
  auto pairs = pairs_of({{-10, -10, 0}, {10, -10, 0}, {10, 10, 0}, {-10, 10, 0}}, truth);
  for (auto& pair : pairs) pair.sigma_m = sigma_m;
  const auto fit = fit_frame(pairs, {.model = FrameModel::four});
  ASSERT_TRUE(fit.has_value());
  const Eigen::Matrix3d local_m2 = Vector3d(0.09, 0.01, 0.04).asDiagonal();
  const auto told = fit.value().enu_covariance({30, 40, 0}, local_m2);
  ASSERT_TRUE(told);
  // The long axis of the local ellipse, x, points 30 degrees north of east.
  const double plane = sigma_m * sigma_m * (0.25 + 2500.0 / 800.0), c2 = 0.75, s2 = 0.25,
               cs = std::sqrt(3) / 4;
  EXPECT_NEAR((*told)(0, 0), 0.09 * c2 + 0.01 * s2 + plane, 1e-9);
  EXPECT_NEAR((*told)(1, 1), 0.09 * s2 + 0.01 * c2 + plane, 1e-9);
  EXPECT_NEAR((*told)(0, 1), (0.09 - 0.01) * cs, 1e-9);
  EXPECT_NEAR((*told)(2, 2), 0.04 + sigma_m * sigma_m / 4, 1e-9);
  // A fit that does not know how good it is claims nothing, and not that it is perfect.
  FrameFit bare = fit.value();
  bare.covariance.reset();
  EXPECT_FALSE(bare.enu_covariance({30, 40, 0}, local_m2));
}

TEST(FrameFit, WeighsPairsByTheirSigma) {
  auto pairs = pairs_of(k_hall, turned(FrameModel::seven, 0, 0, 1));
  for (auto& pair : pairs) pair.sigma_m = 0.01;
  pairs[2].enu_m += Vector3d(1, 0, 0);
  pairs[2].sigma_m = 100.0;  // as good as absent
  const auto fit = fit_frame(pairs);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT(fit.value().residuals[0].residual_m.norm(), 1e-6);
  EXPECT_NEAR(fit.value().residuals[2].residual_m.x(), 1.0, 1e-6);
}

TEST(FrameFit, ShowsAWrongPairByLeavingItOut) {
  std::vector<Vector3d> places = k_hall;
  places.push_back({7, 15, 3});
  auto pairs = pairs_of(places, turned(FrameModel::four, 45, 0, 1));
  pairs[1].enu_m += Vector3d(0, 0.4, 0);
  const auto fit = fit_frame(pairs, {.model = FrameModel::four});
  ASSERT_TRUE(fit.has_value());
  ASSERT_TRUE(fit.value().residuals[1].left_out_m.has_value());
  EXPECT_NEAR(fit.value().residuals[1].left_out_m->y(), 0.4, 1e-9);
  EXPECT_LT(fit.value().residuals[1].residual_m.norm(), 0.3);  // the fit itself hides part of it
  ASSERT_EQ(fit.value().notes.size(), 1U);
  EXPECT_EQ(fit.value().notes[0].find("pair p1 lies 0.400 m"), 0U) << fit.value().notes[0];
}

TEST(FrameFit, SaysThatExactlyEnoughPairsProveNothing) {
  const auto truth = turned(FrameModel::seven, 10, 0, 1);
  const auto fit = fit_frame(pairs_of({k_hall[0], k_hall[1], k_hall[2]}, truth), {.fit_scale = true});
  ASSERT_TRUE(fit.has_value());
  EXPECT_EQ(fit.value().dof, 2);
  const auto two = fit_frame(pairs_of({k_hall[0], k_hall[1]}, turned(FrameModel::four, 10, 0, 1)),
                             {.model = FrameModel::four});
  ASSERT_TRUE(two.has_value());
  EXPECT_FALSE(two.value().residuals[0].left_out_m.has_value());
}

TEST(FrameFit, RefusesPairsThatDoNotDetermineIt) {
  const auto truth = turned(FrameModel::seven, 10, 0, 1);
  const auto code = [](const std::vector<FramePair>& pairs, FrameModel model) {
    const auto fit = fit_frame(pairs, {.model = model});
    return fit ? Errc::internal : fit.error().code;
  };
  EXPECT_EQ(code({}, FrameModel::four), Errc::too_few_observations);
  EXPECT_EQ(code(pairs_of({k_hall[0], k_hall[1]}, truth), FrameModel::seven), Errc::too_few_observations);
  EXPECT_EQ(code(pairs_of({k_hall[0], k_hall[0], k_hall[0]}, truth), FrameModel::four), Errc::weak_geometry);
  EXPECT_EQ(code(pairs_of({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {5, 5, 5}}, truth), FrameModel::seven),
            Errc::weak_geometry);
  // A vertical mast says nothing about the yaw.
  EXPECT_EQ(code(pairs_of({{1, 1, 0}, {1, 1, 5}, {1, 1, 9}}, truth), FrameModel::four), Errc::weak_geometry);
  auto broken = pairs_of(k_hall, truth);
  broken[3].enu_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(code(broken, FrameModel::seven), Errc::invalid_argument);
  auto half = pairs_of(k_hall, truth);
  half[0].sigma_m = 0.1;
  EXPECT_EQ(code(half, FrameModel::seven), Errc::invalid_argument);
}

TEST(FrameFit, PointsOutALeftHandedFrame) {
  auto pairs = pairs_of(k_hall, turned(FrameModel::four, 0, 0, 1));
  for (auto& pair : pairs) pair.local_m.y() = -pair.local_m.y();
  const auto fit = fit_frame(pairs, {.model = FrameModel::four});
  ASSERT_TRUE(fit.has_value());
  EXPECT_GT(fit.value().rms_m, 1.0);
  ASSERT_FALSE(fit.value().notes.empty());
  EXPECT_NE(fit.value().notes[0].find("left-handed"), std::string::npos);
}

TEST(FrameFit, KeepsTheScaleWhenTold) {
  const auto fit = fit_frame(pairs_of(k_hall, turned(FrameModel::seven, 12, 0, 1.01)), {.fit_scale = false});
  ASSERT_TRUE(fit.has_value());
  EXPECT_EQ(fit.value().transform.scale, 1.0);
  EXPECT_EQ((*fit.value().covariance)(6, 6), 0.0);
}

}  // namespace
}  // namespace anchord::frame_fit_test
