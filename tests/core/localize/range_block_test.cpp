// Sums over four ranges at a time against the definition, one range after the other.
#include "core/localize/range_block.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace anchord::range_block_test {
namespace {

using Random = std::mt19937_64;

std::vector<Observation> made_rows(std::size_t count, bool balls, Random& random) {
  std::normal_distribution<double> normal(0, 1);
  std::vector<Observation> rows;
  for (std::size_t i = 0; i < count; ++i) {
    Observation row;
    row.tag_m = 10 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    row.distance_m = (row.tag_m - Eigen::Vector3d(3, 4, 2)).norm() + 0.3 * normal(random);
    row.sigma_m = 0.03 + 0.1 * std::abs(normal(random));
    const Eigen::Matrix3d root = balls ? Eigen::Matrix3d(0.02 * Eigen::Matrix3d::Identity())
                                       : Eigen::Matrix3d(0.05 * Eigen::Matrix3d::NullaryExpr([&](auto, auto) {
                                                           return normal(random);
                                                         }));
    row.tag_covariance_m2 = root * root.transpose();
    rows.push_back(row);
  }
  return rows;
}

/// Second derivatives of half the sum of rho by differences of the gradient.
RangeNormal by_definition(const std::vector<Observation>& rows, const Unknowns& at, const Unknowns& scaled_at,
                          Weights weights, Loss loss, double bend) {
  RangeNormal n;
  for (const Observation& row : rows) {
    const RowScale scale = row_scale(row, scaled_at, weights);
    Eigen::Vector4d u;
    const double e_m = residual_m(row, at, &u);
    const LossValue value = loss_value(loss, bend, e_m / scale.sigma_m);
    const double m2 = scale.factor * scale.factor;
    const double weight = value.weight * m2 / (scale.sigma_m * scale.sigma_m);
    n.matrix += weight * u * u.transpose();
    n.gradient += weight * e_m * u;
    n.cost += 0.5 * m2 * value.rho;
  }
  return n;
}

struct Case {
  Loss loss;
  Weights weights;
  std::size_t count;
  bool balls;
};
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const Loss loss : {Loss::none, Loss::huber, Loss::cauchy, Loss::tukey}) {
    for (const Weights weights : {Weights::inverse_variance, Weights::as_printed}) {
      for (const std::size_t count : {1U, 4U, 7U, 201U}) {
        all.push_back({loss, weights, count, true});
        all.push_back({loss, weights, count, false});
      }
    }
  }
  return all;
}

TEST(RangeBlock, SumsWhatTheDefinitionSums) {
  Random random(4);
  for (const Case& c : cases()) {
    const auto rows = made_rows(c.count, c.balls, random);
    const Unknowns at(2.5, 4.2, 1.5, 0.1);
    RangeBlock block(rows);
    block.scale(at, c.weights);
    const RangeNormal sums = block.normal(at, c.loss, 1.5);
    const RangeNormal plain = by_definition(rows, at, at, c.weights, c.loss, 1.5);
    const double size = plain.matrix.norm();
    EXPECT_LE((sums.matrix - plain.matrix).norm(), 1e-12 * size);
    EXPECT_LE((sums.gradient - plain.gradient).norm(), 1e-12 * size);
    EXPECT_NEAR(sums.cost, plain.cost, 1e-12 * (1 + plain.cost));
    EXPECT_EQ(block.residuals_m(at).size(), c.count);
    EXPECT_DOUBLE_EQ(block.residuals_m(at).back(), residual_m(rows.back(), at, nullptr));
  }
}

// The curvature is the derivative of the gradient, which the definition gives.
TEST(RangeBlock, BendsAsTheGradientChanges) {
  Random random(5);
  for (const Case& c : cases()) {
    if (c.loss == Loss::huber) continue;  // its slope jumps, and a difference may straddle that
    const auto rows = made_rows(c.count, c.balls, random);
    const Unknowns at(2.5, 4.2, 1.5, 0.1);
    RangeBlock block(rows);
    block.scale(at, c.weights);
    const Eigen::Matrix4d curvature = block.normal(at, c.loss, 1.5).curvature;
    for (int i = 0; i < 4; ++i) {
      constexpr double step = 1e-5;
      const Unknowns d = step * Unknowns::Unit(i);
      const Eigen::Vector4d slope = -(by_definition(rows, at + d, at, c.weights, c.loss, 1.5).gradient -
                                      by_definition(rows, at - d, at, c.weights, c.loss, 1.5).gradient) /
                                    (2 * step);
      EXPECT_LT((slope - curvature.col(i)).norm(), 1e-5 * (1 + curvature.norm()));
    }
  }
}

TEST(RangeBlock, AnswersAlikeInAnyRegisters) {
  Random random(6);
  for (const Case& c : cases()) {
    const auto rows = made_rows(c.count, c.balls, random);
    const Unknowns at(2.5, 4.2, 1.5, 0.1);
    RangeBlock block(rows);
    block.scale(at, c.weights);
    const RangeNormal any = block.normal(at, c.loss, 1.5, Registers::any);
    const RangeNormal widest = block.normal(at, c.loss, 1.5, Registers::widest);
    EXPECT_EQ(any.matrix, widest.matrix);
    EXPECT_EQ(any.curvature, widest.curvature);
    EXPECT_EQ(any.gradient, widest.gradient);
    EXPECT_EQ(any.cost, widest.cost);
  }
}

TEST(RangeBlock, TakesARangeOfNoDistanceAndOneFarOff) {
  Observation on_the_tag, far_off;
  on_the_tag.tag_m = {1, 2, 3};
  on_the_tag.distance_m = 0.1;
  on_the_tag.sigma_m = far_off.sigma_m = 1e-3;
  far_off.tag_m = {1, 2, 4};
  far_off.distance_m = 1e9;
  const std::vector<Observation> rows{on_the_tag, far_off, far_off, far_off, far_off, far_off};
  const Unknowns at(1, 2, 3, 0);
  for (const Loss loss : {Loss::huber, Loss::cauchy, Loss::tukey}) {
    RangeBlock block(rows);
    block.scale(at, Weights::inverse_variance);
    const RangeNormal sums = block.normal(at, loss, 1.5);
    EXPECT_TRUE(sums.matrix.allFinite() && sums.curvature.allFinite() && sums.gradient.allFinite());
    EXPECT_NEAR(sums.cost, by_definition(rows, at, at, Weights::inverse_variance, loss, 1.5).cost,
                1e-9 * sums.cost);
  }
}

}  // namespace
}  // namespace anchord::range_block_test
