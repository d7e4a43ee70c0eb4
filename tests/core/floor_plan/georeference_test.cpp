// Expected values by hand: a similarity of known turn, scale and shift applied to round pixel numbers.
#include "core/floor_plan/georeference.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace anchord::floor_plan::georeference_test {
namespace {

/// 2 cm per pixel, turned by 30 degrees, its upper left corner at (100, -40) m.
Eigen::Vector2d truth(const Eigen::Vector2d& pixel) {
  const double c = std::cos(std::numbers::pi / 6), s = std::sin(std::numbers::pi / 6);
  const double x = 0.02 * pixel.x(), y = -0.02 * pixel.y();
  return {100 + c * x - s * y, -40 + s * x + c * y};
}

std::vector<PixelPair> exact(std::initializer_list<Eigen::Vector2d> pixels) {
  std::vector<PixelPair> pairs;
  for (const auto& pixel : pixels) pairs.push_back({"", pixel, truth(pixel)});
  return pairs;
}
const std::initializer_list<Eigen::Vector2d> k_three{{100, 100}, {1900, 150}, {1000, 1400}};
const std::initializer_list<Eigen::Vector2d> k_four{{100, 100}, {1900, 150}, {1000, 1400}, {150, 1300}};
const std::initializer_list<Eigen::Vector2d> k_five{
    {100, 100}, {1900, 150}, {1000, 1400}, {150, 1300}, {1850, 1350}};

TEST(PlanFit, RecoversScaleTurnAndShiftOfExactPoints) {
  for (const auto model : {FitModel::helmert, FitModel::affine}) {
    const auto pairs = exact(k_four);
    const auto fit = fit_plan(pairs, {.model = model});
    ASSERT_TRUE(fit.has_value());
    EXPECT_NEAR(fit.value().transform.scale_m_per_px(), 0.02, 1e-12);
    EXPECT_NEAR(fit.value().transform.turn_deg(), 30, 1e-9);
    EXPECT_LT(fit.value().rms_m, 1e-9);
    EXPECT_LT((fit.value().transform.enu_from({0, 0}) - Eigen::Vector2d(100, -40)).norm(), 1e-9);
    EXPECT_LT((fit.value().transform.pixel_from({100, -40})).norm(), 1e-6);  // pixels: 1e-6 is 20 nm
    EXPECT_FALSE(fit.value().wrong);
  }
}

TEST(PlanFit, NamesTheWrongOneOfFourPoints) {
  for (std::size_t k = 0; k < 4; ++k) {
    auto pairs = exact(k_four);
    pairs[k].enu_m += Eigen::Vector2d(1.2, -0.9);
    const auto fit = fit_plan(pairs);
    ASSERT_TRUE(fit.has_value());
    ASSERT_TRUE(fit.value().wrong) << k;
    EXPECT_EQ(*fit.value().wrong, k);
    ASSERT_FALSE(fit.value().notes.empty());
    EXPECT_NE(fit.value().notes[0].find("point " + std::to_string(k + 1)), std::string::npos);
    EXPECT_NE(fit.value().notes[0].find("1.50 m"), std::string::npos) << fit.value().notes[0];
  }
}

TEST(PlanFit, NamesTheWrongOneOfFivePointsInAnAffineFit) {
  for (std::size_t k = 0; k < 5; ++k) {
    auto pairs = exact(k_five);
    pairs[k].enu_m += Eigen::Vector2d(-2, 1);
    const auto fit = fit_plan(pairs, {.model = FitModel::affine});
    ASSERT_TRUE(fit.has_value());
    EXPECT_EQ(fit.value().wrong, std::optional(k));
  }
}

// With redundancy 2 every pair alone explains the residuals exactly: sum c_k (q_k + d_k) = 0 has one complex
// equation and one complex unknown for each k, so that blame would be a guess.
TEST(PlanFit, SaysThatThreePointsCannotShowWhichOneIsWrong) {
  for (std::size_t k = 0; k < 3; ++k) {
    auto pairs = exact(k_three);
    pairs[k].enu_m += Eigen::Vector2d(1.2, -0.9);
    const auto fit = fit_plan(pairs);
    ASSERT_TRUE(fit.has_value());
    EXPECT_FALSE(fit.value().wrong);
    EXPECT_GT(fit.value().rms_m, 0.2);
    EXPECT_EQ(fit.value().redundancy, 2);
    ASSERT_FALSE(fit.value().notes.empty());
    EXPECT_NE(fit.value().notes[0].find("cannot show which one"), std::string::npos);
  }
}

TEST(PlanFit, NamesTheWrongOneOfThreePointsWhereTheScaleIsKnown) {
  for (std::size_t k = 0; k < 3; ++k) {
    auto pairs = exact(k_three);
    pairs[k].name = "corner";
    pairs[k].enu_m += Eigen::Vector2d(1.2, -0.9);
    PlanFitOptions options;
    options.known_scale_m_per_px = 0.02;
    const auto fit = fit_plan(pairs, options);
    ASSERT_TRUE(fit.has_value());
    EXPECT_EQ(fit.value().wrong, std::optional(k));
    EXPECT_NE(fit.value().notes[0].find("(corner)"), std::string::npos);
  }
}

TEST(PlanFit, CallsNobodyWrongForTheErrorsOfCarefulClicks) {
  auto pairs = exact(k_five);
  const double off[5][2] = {{0.1, -0.05}, {-0.12, 0.08}, {0.05, 0.1}, {-0.08, -0.1}, {0.06, -0.02}};
  for (std::size_t k = 0; k < 5; ++k) pairs[k].enu_m += Eigen::Vector2d(off[k][0], off[k][1]);
  const auto fit = fit_plan(pairs);
  ASSERT_TRUE(fit.has_value());
  EXPECT_FALSE(fit.value().wrong);
  EXPECT_TRUE(fit.value().notes.empty());
  EXPECT_NEAR(fit.value().rms_m, 0.1, 0.06);
}

TEST(PlanFit, SaysThatAFitWithoutRedundancyProvesNothing) {
  auto pairs = exact(k_three);
  pairs[1].enu_m.x() += 7;
  const auto fit = fit_plan(pairs, {.model = FitModel::affine});
  ASSERT_TRUE(fit.has_value());
  EXPECT_EQ(fit.value().redundancy, 0);
  EXPECT_FALSE(fit.value().wrong);
  EXPECT_FALSE(fit.value().residuals[0].left_out_m);
  EXPECT_NE(fit.value().notes[0].find("prove nothing"), std::string::npos);
}

TEST(PlanFit, AsksWhetherTwoPointsAreSwapped) {
  auto pairs = exact({{0, 0}, {1000, 0}, {0, 1000}});
  std::swap(pairs[1].enu_m, pairs[2].enu_m);
  const auto fit = fit_plan(pairs);
  ASSERT_TRUE(fit.has_value());
  EXPECT_NE(fit.value().notes.back().find("swapped"), std::string::npos);
}

TEST(PlanFit, RefusesPointsThatTellNothing) {
  EXPECT_EQ(fit_plan(exact({{5, 5}})).error().code, Errc::too_few_observations);
  EXPECT_EQ(fit_plan(exact({{5, 5}, {500, 5}}), {.model = FitModel::affine}).error().code,
            Errc::too_few_observations);
  EXPECT_EQ(fit_plan(exact({{5, 5}, {6, 5}, {5, 6}})).error().code, Errc::weak_geometry);
  EXPECT_EQ(fit_plan(exact({{0, 0}, {500, 0}, {1000, 1}}), {.model = FitModel::affine}).error().code,
            Errc::weak_geometry);
  auto pairs = exact(k_three);
  pairs[2].enu_m.x() = std::nan("");
  EXPECT_EQ(fit_plan(pairs).error().code, Errc::invalid_argument);
}

}  // namespace
}  // namespace anchord::floor_plan::georeference_test
