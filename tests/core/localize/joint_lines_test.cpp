#include "core/localize/joint_lines.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/localize/residual.hpp"

namespace anchord::joint_lines_test {
namespace {

/// 30 s with a gap, a position that is not good enough, and an attitude on request; the spread of a position
/// is no ball, and no two are alike.
TagTrack lines_track(bool attitude) {
  std::vector<Fix> fixes;
  for (int i = 0; i < 150; ++i) {
    if (i > 60 && i < 70) continue;
    Fix fix;
    fix.time = UtcTime::from_seconds(0.2 * i);
    fix.frame = TrackFrame::local;
    fix.local_m = {9 * std::cos(0.05 * i), 7 * std::sin(0.06 * i), 3 + 2 * std::sin(0.11 * i)};
    fix.fix = i == 100 ? FixClass::rtk_float : FixClass::rtk_fixed;
    Eigen::Matrix3d covariance_m2;
    covariance_m2 << 4, 1, -0.5, 1, 3, 0.7, -0.5, 0.7, 9;
    fix.covariance_m2 = covariance_m2 * 1e-4 * (1 + 0.1 * (i % 7));
    if (attitude)
      fix.enu_from_body =
          Eigen::Quaterniond(Eigen::AngleAxisd(0.02 * i, Eigen::Vector3d(0.1, 0.2, 1).normalized()));
    fixes.push_back(fix);
  }
  return TagTrack(fixes, std::nullopt, UtcTime{}, {.max_gap_s = 1.0});
}

std::vector<JointRow> lines_rows(bool arms) {
  std::vector<JointRow> rows;
  for (int i = 0; i < 333; ++i) {
    JointRow row{.t_s = -0.5 + 0.0953 * i,
                 .distance_m = 4 + 0.03 * i,
                 .lever_arm_body_m = {0.2, -0.4, 0.1 + 0.05 * (i % 2)},
                 .antenna = static_cast<std::uint8_t>(i % 2)};
    if (arms && i % 3 != 0) row.arm = static_cast<std::int8_t>(i % 2);
    rows.push_back(row);
  }
  return rows;
}

const SharedVector k_lines_shared{{0.3, 0.05, 0.012, 0.04, 0.03, -0.05, 0.01, 0.02, -0.03, 0.04}};
const JointState::Anchor k_lines_anchor{{4, 3, 2.5}, 0.02, true};

TEST(JointLines, AreThoseOfEachRowByItself) {
  for (const bool attitude : {false, true}) {
    for (const bool arms : {false, true}) {
      const TagTrack track = lines_track(attitude);
      const auto rows = lines_rows(arms);
      const JointLines lines(track, rows, k_lines_shared, k_lines_anchor);
      std::array<std::size_t, 4> refused{};
      std::size_t n = 0;
      for (const JointRow& row : rows) {
        const JointLine line = linearise(track, row, k_lines_shared, k_lines_anchor);
        if (line.refused != TrackRefusal::none) {
          ++refused[static_cast<std::size_t>(line.refused)];
          continue;
        }
        ASSERT_LT(n, lines.size());
        EXPECT_EQ(lines.rows()[n], &row);
        const auto of = [&](JointLines::Column column) { return lines.of(column)[n]; };
        for (int k = 0; k < 3; ++k)
          EXPECT_NEAR(of(static_cast<JointLines::Column>(k)), line.by_anchor[k], 1e-13);
        EXPECT_NEAR(of(JointLines::curve), line.by_shared[k_shared_curve], 1e-13);
        EXPECT_NEAR(of(JointLines::lag), line.by_shared[k_shared_lag], 1e-12);
        EXPECT_NEAR(of(JointLines::lever), line.by_shared[k_shared_lever], 1e-13);
        EXPECT_NEAR(of(JointLines::forward), line.by_shared[k_shared_forward], 1e-13);
        EXPECT_NEAR(of(JointLines::left), line.by_shared[k_shared_left], 1e-13);
        EXPECT_NEAR(of(JointLines::residual), line.residual_m, 1e-13);
        EXPECT_NEAR(of(JointLines::variance), line.position_variance_m2, 1e-16);
        const JointLine whole = lines.line(n);
        EXPECT_LT((whole.antenna_m - line.antenna_m).norm(), 1e-13);
        EXPECT_LT((whole.by_anchor - line.by_anchor).norm(), 1e-13);
        EXPECT_LT((whole.by_shared - line.by_shared).norm(), 1e-12);
        EXPECT_EQ(whole.residual_m, of(JointLines::residual));
        EXPECT_EQ(whole.position_variance_m2, of(JointLines::variance));
        ++n;
      }
      EXPECT_EQ(lines.size(), n);
      EXPECT_EQ(lines.refused(), refused);
      EXPECT_GT(n, 200U);
      for (const auto why : {TrackRefusal::outside, TrackRefusal::gap, TrackRefusal::fix_class})
        EXPECT_GT(refused[static_cast<std::size_t>(why)], 0U);
    }
  }
}

TEST(JointLines, WeighAsTheLossDoes) {
  const TagTrack track = lines_track(true);
  const auto rows = lines_rows(false);
  const JointLines lines(track, rows, k_lines_shared, k_lines_anchor);
  const FlightOptions options;
  const double scale_m = 1.7, usual_m2 = 4e-4;
  const auto weights =
      tukey_weights(lines, scale_m * scale_m, usual_m2, default_bend(Loss::tukey) * options.mad_factor);
  std::size_t n_rejected = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double v = scale_m * scale_m + std::max(lines.of(JointLines::variance)[i] - usual_m2, 0.0);
    const double expected =
        robust_weight(lines.of(JointLines::residual)[i] / std::sqrt(v), options) * scale_m * scale_m / v;
    EXPECT_NEAR(weights[i], expected, 1e-13);
    n_rejected += weights[i] == 0 ? 1 : 0;
  }
  EXPECT_GT(n_rejected, 10U);
  EXPECT_LT(n_rejected, lines.size() - 10);
}

TEST(JointLines, MultiplyAsManyColumnsAsThereAre) {
  for (const std::size_t n : {1U, 9U, 10U, 11U, 14U, 21U}) {
    std::vector<std::vector<double>> columns(n, std::vector<double>(52));
    std::vector<double> weights(52);
    std::vector<const double*> begins;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < 52; ++k) {
        const double at = static_cast<double>(7 * i + 3 * k);
        columns[i][k] = std::sin(at), weights[k] = k < 50 ? 1.0 + 0.01 * static_cast<double>(k) : 0.0;
      }
      begins.push_back(columns[i].data());
    }
    const auto products = weighted_products(begins, weights);
    ASSERT_EQ(products.size(), n * n);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        double expected = 0;
        for (std::size_t k = 0; k < 52; ++k) expected += weights[k] * columns[i][k] * columns[j][k];
        EXPECT_NEAR(products[i * n + j], expected, 1e-12) << n;
      }
  }
}

TEST(JointLines, SumToTheNormalEquationsOfTheirDerivatives) {
  for (const bool attitude : {false, true}) {
    for (const bool arms : {false, true}) {
      const TagTrack track = lines_track(attitude);
      const auto rows = lines_rows(arms);
      const JointLines lines(track, rows, k_lines_shared, k_lines_anchor);
      std::vector<double> weights;
      for (std::size_t i = 0; i < lines.size(); ++i)
        weights.push_back(i % 5 == 0 ? 0.0 : 0.2 + 0.01 * static_cast<double>(i % 7));
      AnchorBlock block;
      JointNormal normal;
      add_lines(lines, weights, 3.0, block, normal);
      AnchorBlock expected;
      JointNormal all;
      for (std::size_t i = 0; i < lines.size(); ++i) {
        const JointLine line = linearise(track, *lines.rows()[i], k_lines_shared, k_lines_anchor);
        const double w = 3.0 * weights[i];
        expected.own += w * line.by_anchor * line.by_anchor.transpose();
        expected.shared += w * line.by_anchor * line.by_shared.transpose();
        expected.gradient += w * line.by_anchor * line.residual_m;
        all.shared += w * line.by_shared * line.by_shared.transpose();
        all.shared_gradient += w * line.by_shared * line.residual_m;
      }
      EXPECT_LT((block.own - expected.own).norm(), 1e-12 * expected.own.norm());
      EXPECT_LT((block.shared - expected.shared).norm(), 1e-12 * expected.shared.norm());
      EXPECT_LT((block.gradient - expected.gradient).norm(), 1e-12 * expected.gradient.norm());
      EXPECT_LT((normal.shared - all.shared).norm(), 1e-12 * all.shared.norm());
      EXPECT_LT((normal.shared_gradient - all.shared_gradient).norm(), 1e-12 * all.shared_gradient.norm());
    }
  }
}

TEST(JointLines, SayWhatAllRowsHaveInCommon) {
  const TagTrack turned = lines_track(true), level = lines_track(false);
  const auto apart = lines_rows(true);
  auto alike = lines_rows(false);
  for (JointRow& row : alike) row.antenna = 0;
  const JointLines one(level, alike, k_lines_shared, k_lines_anchor);
  EXPECT_TRUE(one.level() && one.one_arm() && one.one_antenna() && one.without_models());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one.of(JointLines::stamp)[i], one.rows()[i]->t_s);
  const JointLines two(turned, apart, k_lines_shared, k_lines_anchor);
  EXPECT_FALSE(two.level() || two.one_arm() || two.one_antenna());
  const RangeErrorModel model;
  alike[200].error_model = &model;
  EXPECT_FALSE(JointLines(level, alike, k_lines_shared, k_lines_anchor).without_models());
}

}  // namespace
}  // namespace anchord::joint_lines_test
