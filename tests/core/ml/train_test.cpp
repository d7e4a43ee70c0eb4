#include "core/ml/train.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/ml/random.hpp"

namespace anchord::ml::train_test {
namespace {

struct Sample {
  std::vector<double> x, y, w;
  std::size_t d;
  TrainingRows rows() const { return {x, d, y, w}; }
};

double gauss(Random& r) {  // sum of twelve uniforms: mean 0, sd 1
  double s = -6;
  for (int i = 0; i < 12; ++i) s += r.uniform();
  return s;
}

// Two features; log odds 2 x0 - 1 x1 + 0.5.
Sample logistic_world(std::size_t n, std::uint64_t seed) {
  Sample s{{}, {}, {}, 2};
  Random r{seed};
  for (std::size_t i = 0; i < n; ++i) {
    const double a = gauss(r), b = gauss(r);
    s.x.insert(s.x.end(), {a, b});
    s.y.push_back(r.uniform() < 1 / (1 + std::exp(-(2 * a - b + 0.5))) ? 1 : 0);
    s.w.push_back(1);
  }
  return s;
}

Sample ring(std::size_t n, std::uint64_t seed) {
  Sample s{{}, {}, {}, 2};
  Random r{seed};
  for (std::size_t i = 0; i < n; ++i) {
    const double a = gauss(r), b = gauss(r);
    s.x.insert(s.x.end(), {a, b});
    s.y.push_back(a * a + b * b < 1.4 ? 1 : 0);
    s.w.push_back(1);
  }
  return s;
}

double hit_rate(const Scorer& scorer, const Sample& s, double threshold) {
  double right = 0;
  for (std::size_t i = 0; i < s.y.size(); ++i)
    right += (score(scorer, s.rows().row(i)) > threshold) == (s.y[i] > 0.5) ? 1 : 0;
  return right / static_cast<double>(s.y.size());
}

}  // namespace

TEST(Logistic, RecoversTheWorldsOwnWeights) {
  const auto s = logistic_world(20000, 3);
  const auto m = fit_logistic(s.rows(), 1e3);
  EXPECT_NEAR(m.weights[0], 2, 0.1);  // standard error about 0.03
  EXPECT_NEAR(m.weights[1], -1, 0.1);
  EXPECT_NEAR(m.offset, 0.5, 0.1);
}

// One feature +-1, half a class each side: with the penalty w^2 / (2C) the optimum solves 2n sigmoid(-w) = w
// / C; n = 2 pairs, C = 1: w = 1.2024.
TEST(Logistic, StaysFiniteOnSeparableClasses) {
  const Sample s{{1, 1, -1, -1}, {1, 1, 0, 0}, {1, 1, 1, 1}, 1};
  const double w = fit_logistic(s.rows(), 1).weights[0];
  EXPECT_NEAR(4 / (1 + std::exp(w)), w, 1e-6);
}

TEST(Platt, NeverTurnsAScoreRound) {
  const std::vector<double> score{-2, -1, 1, 2}, y{1, 1, 0, 1}, w{1, 1, 1, 1};
  const auto p = fit_platt(score, y, w);
  EXPECT_EQ(p.slope, 0);
  EXPECT_NEAR(p.offset, std::log(3.0), 1e-9);
}

TEST(Polynomial, RecoversACubicAndAnInteraction) {
  Sample s{{}, {}, {}, 2};
  Random r{5};
  for (int i = 0; i < 200; ++i) {
    const double a = gauss(r), b = gauss(r);
    s.x.insert(s.x.end(), {a, b});
    s.y.push_back(0.3 - 0.2 * a * a * a + 0.7 * a * b);
    s.w.push_back(1);
  }
  const auto m = fit_polynomial(s.rows(), polynomial_terms(2, 3, true), 0);
  EXPECT_EQ(m.terms.size(), 10U);  // (2 + 3 choose 3)
  const std::vector<double> at{1.5, -2.0};
  EXPECT_NEAR(score(m, at), 0.3 - 0.2 * 3.375 - 2.1, 1e-6);
  EXPECT_EQ(polynomial_terms(1, 4, false).size(), 5U);
}

TEST(LeastAbsolute, ShrugsOffAThirdOfWildRows) {
  Sample s{{}, {}, {}, 1};
  Random r{9};
  for (int i = 0; i < 300; ++i) {
    const double a = gauss(r);
    s.x.push_back(a);
    s.y.push_back(0.1 + 0.05 * a + (i % 3 == 0 ? 2 * r.uniform() : 0));
    s.w.push_back(1);
  }
  const auto m = fit_least_absolute(s.rows(), 0);
  EXPECT_NEAR(m.offset, 0.1, 0.01);
  EXPECT_NEAR(m.weights[0], 0.05, 0.01);
}

TEST(Forest, LearnsARingAndKeepsItsOutOfBagRowsHonest) {
  const auto train = ring(1500, 1), fresh = ring(1000, 2);
  std::vector<double> oob;
  TreeOptions o;
  o.leaf_share = 0.005;
  const auto m = fit_forest(train.rows(), o, &oob);
  EXPECT_GT(hit_rate(m, fresh, 0.5), 0.93);
  double right = 0;
  for (std::size_t i = 0; i < oob.size(); ++i) right += (oob[i] > 0.5) == (train.y[i] > 0.5) ? 1 : 0;
  EXPECT_NEAR(right / 1500, hit_rate(m, fresh, 0.5), 0.03);
}

TEST(Forest, IsTheSameForTheSameSeedAndAnotherForAnother) {
  const auto s = ring(300, 1);
  const std::vector<double> at{0.4, -0.7};
  TreeOptions o;
  o.trees = 20;
  const auto a = fit_forest(s.rows(), o), b = fit_forest(s.rows(), o);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  EXPECT_EQ(score(a, at), score(b, at));
  o.seed = 2;
  EXPECT_NE(score(fit_forest(s.rows(), o), at), score(a, at));
}

TEST(Boosted, LearnsARingAndAWave) {
  const auto train = ring(1500, 1), fresh = ring(1000, 2);
  BoostOptions o;
  o.rounds = 150;
  o.depth = 3;
  o.column_share = 1;
  EXPECT_GT(hit_rate(fit_boosted(train.rows(), o), fresh, 0), 0.95);
  Sample wave{{}, {}, {}, 1};
  for (int i = 0; i < 500; ++i)
    wave.x.push_back(i * 0.01), wave.y.push_back(std::sin(i * 0.01)), wave.w.push_back(1);
  o.classification = false;
  const std::vector<double> at{1.5};
  EXPECT_NEAR(score(fit_boosted(wave.rows(), o), at), std::sin(1.5), 0.02);
}

TEST(Svm, LearnsARingWithRbfAndALineWithTheLinearKernel) {
  const auto train = ring(400, 1), fresh = ring(1000, 2);
  const auto rbf = fit_svm(train.rows(), {Kernel::rbf, 10, 0.5, 0, 3, 0.01}, true);
  ASSERT_TRUE(rbf);
  EXPECT_GT(hit_rate(rbf.value(), fresh, 0), 0.94);
  Sample line{{}, {}, {}, 1};
  for (int i = 0; i < 50; ++i)
    line.x.push_back(0.1 * i), line.y.push_back(0.3 * 0.1 * i), line.w.push_back(1);
  const auto svr = fit_svm(line.rows(), {Kernel::linear, 10, 0.5, 0, 3, 0.01}, false);
  const std::vector<double> at{2.5};
  EXPECT_NEAR(score(svr.value(), at), 0.75, 0.02);
  const Sample one_class{{1, 2}, {1, 1}, {1, 1}, 1};
  EXPECT_FALSE(fit_svm(one_class.rows(), {}, true));
}

}  // namespace anchord::ml::train_test
