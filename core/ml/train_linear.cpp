#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/ml/train.hpp"

namespace anchord::ml {
namespace {

using RowMatrix = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

Eigen::Index index(std::size_t i) { return static_cast<Eigen::Index>(i); }

// Columns of the features with a last column of ones.
Eigen::MatrixXd with_ones(const TrainingRows& rows) {
  Eigen::MatrixXd x(index(rows.n()), index(rows.d + 1));
  x.leftCols(index(rows.d)) = RowMatrix(rows.x.data(), index(rows.n()), index(rows.d));
  x.col(index(rows.d)).setOnes();
  return x;
}

Linear to_linear(const Eigen::VectorXd& beta) {
  Linear model;
  model.weights.assign(beta.data(), beta.data() + beta.size() - 1);
  model.offset = beta[beta.size() - 1];
  return model;
}

double logistic_loss(const Eigen::VectorXd& z, const Eigen::VectorXd& y, const Eigen::VectorXd& w) {
  double sum = 0;
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    const double margin = y[i] > 0.5 ? z[i] : -z[i];
    sum += w[i] * (margin > 0 ? std::log1p(std::exp(-margin)) : -margin + std::log1p(std::exp(margin)));
  }
  return sum;
}

// Newton with halved steps on the penalised loss; the last column is the free constant.
Eigen::VectorXd irls(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const Eigen::VectorXd& w,
                     double penalty) {
  const Eigen::Index d = x.cols();
  Eigen::VectorXd beta = Eigen::VectorXd::Zero(d), ridge = Eigen::VectorXd::Constant(d, penalty);
  ridge[d - 1] = 1e-9;
  const auto loss = [&](const Eigen::VectorXd& b) {
    return logistic_loss(x * b, y, w) + 0.5 * b.cwiseAbs2().dot(ridge);
  };
  double best = loss(beta);
  for (int round = 0; round < 100; ++round) {
    const Eigen::VectorXd p = (1 + (-(x * beta)).array().exp()).inverse();
    const Eigen::VectorXd curvature = (w.array() * p.array() * (1 - p.array())).max(1e-12);
    const Eigen::VectorXd gradient =
        x.transpose() * (w.array() * (p - y).array()).matrix() + ridge.cwiseProduct(beta);
    Eigen::MatrixXd hessian = x.transpose() * curvature.asDiagonal() * x;
    hessian.diagonal() += ridge;
    const Eigen::VectorXd step = hessian.ldlt().solve(gradient);
    double scale = 1;
    double now = loss(beta - step);
    while (!(now <= best) && scale > 1e-6) {
      scale *= 0.5;
      now = loss(beta - scale * step);
    }
    if (!(now <= best)) break;
    beta -= scale * step;
    if (best - now < 1e-10 * (1 + std::abs(best))) break;
    best = now;
  }
  return beta;
}

Eigen::Map<const Eigen::VectorXd> map(std::span<const double> v) { return {v.data(), index(v.size())}; }

}  // namespace

double weighted_median(std::vector<std::pair<double, double>> value_and_weight) {
  if (value_and_weight.empty()) return 0;
  std::sort(value_and_weight.begin(), value_and_weight.end());
  double total = 0;
  for (const auto& [value, weight] : value_and_weight) total += weight;
  double below = 0;
  for (std::size_t i = 0; i < value_and_weight.size(); ++i) {
    below += value_and_weight[i].second;
    if (std::abs(below - 0.5 * total) < 1e-9 * total && i + 1 < value_and_weight.size())
      return 0.5 * (value_and_weight[i].first + value_and_weight[i + 1].first);
    if (below > 0.5 * total) return value_and_weight[i].first;
  }
  return value_and_weight.back().first;
}

Scaler fit_scaler(std::span<const double> x, std::size_t d, std::span<const double> w, double clip) {
  Scaler scaler{std::vector<double>(d, 0.0), std::vector<double>(d, 0.0), clip};
  double total = 0;
  for (std::size_t i = 0; i < w.size(); ++i) {
    total += w[i];
    for (std::size_t j = 0; j < d; ++j) scaler.mean[j] += w[i] * x[i * d + j];
  }
  for (auto& m : scaler.mean) m /= std::max(total, 1e-300);
  for (std::size_t i = 0; i < w.size(); ++i)
    for (std::size_t j = 0; j < d; ++j)
      scaler.sd[j] += w[i] * (x[i * d + j] - scaler.mean[j]) * (x[i * d + j] - scaler.mean[j]);
  for (std::size_t j = 0; j < d; ++j) {
    scaler.sd[j] = std::sqrt(scaler.sd[j] / std::max(total, 1e-300));
    if (!(scaler.sd[j] > 1e-9 * (1 + std::abs(scaler.mean[j])))) scaler.sd[j] = 1;
  }
  return scaler;
}

Linear fit_logistic(const TrainingRows& rows, double c) {
  return to_linear(irls(with_ones(rows), map(rows.y), map(rows.w), 1 / c));
}

Platt fit_platt(std::span<const double> score, std::span<const double> y, std::span<const double> w) {
  const auto n = index(score.size());
  Eigen::MatrixXd x(n, 2);
  x.col(0) = map(score);
  x.col(1).setOnes();
  // A whisper of penalty keeps the slope finite where the score separates the classes.
  const Eigen::VectorXd beta = irls(x, map(y), map(w), 1e-2);
  if (beta[0] > 0) return {beta[0], beta[1]};
  // The score says nothing, or the opposite of what it should: answer the base rate.
  const double rate = std::clamp(map(y).dot(map(w)) / map(w).sum(), 0.01, 0.99);
  return {0, std::log(rate / (1 - rate))};
}

std::vector<Polynomial::Term> polynomial_terms(std::size_t d, int degree, bool interactions) {
  std::vector<Polynomial::Term> terms{{}};
  if (!interactions) {
    for (std::size_t f = 0; f < d; ++f)
      for (int power = 1; power <= degree; ++power)
        terms.push_back(
            {std::vector<std::uint16_t>(static_cast<std::size_t>(power), static_cast<std::uint16_t>(f)), 0});
    return terms;
  }
  // Each term grows by features not before its last one, so that every product comes once.
  for (std::size_t at = 0; at < terms.size(); ++at) {
    if (terms[at].features.size() == static_cast<std::size_t>(degree)) continue;
    const std::size_t first = terms[at].features.empty() ? 0 : terms[at].features.back();
    for (std::size_t f = first; f < d; ++f) {
      auto grown = terms[at];
      grown.features.push_back(static_cast<std::uint16_t>(f));
      terms.push_back(std::move(grown));
    }
  }
  return terms;
}

Polynomial fit_polynomial(const TrainingRows& rows, std::vector<Polynomial::Term> terms, double ridge) {
  const auto n = index(rows.n()), m = index(terms.size());
  Eigen::MatrixXd phi(n, m);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto x = rows.row(static_cast<std::size_t>(i));
    for (Eigen::Index t = 0; t < m; ++t) {
      double product = 1;
      for (const auto f : terms[static_cast<std::size_t>(t)].features) product *= x[f];
      phi(i, t) = product;
    }
  }
  const auto w = map(rows.w);
  Eigen::MatrixXd normal = phi.transpose() * w.asDiagonal() * phi;
  const double penalty = ridge * w.sum();
  for (Eigen::Index t = 0; t < m; ++t)
    normal(t, t) += terms[static_cast<std::size_t>(t)].features.empty() ? 1e-12 * w.sum()
                                                                        : std::max(penalty, 1e-10 * w.sum());
  const Eigen::VectorXd coefficients =
      normal.ldlt().solve(phi.transpose() * (w.array() * map(rows.y).array()).matrix());
  for (Eigen::Index t = 0; t < m; ++t) terms[static_cast<std::size_t>(t)].coefficient = coefficients[t];
  return {std::move(terms)};
}

Linear fit_least_absolute(const TrainingRows& rows, double l1_penalty) {
  const Eigen::MatrixXd x = with_ones(rows);
  const auto y = map(rows.y);
  const auto w = map(rows.w);
  const Eigen::Index d = x.cols();
  std::vector<std::pair<double, double>> start;
  for (std::size_t i = 0; i < rows.n(); ++i) start.emplace_back(rows.y[i], rows.w[i]);
  Eigen::VectorXd beta = Eigen::VectorXd::Zero(d);
  beta[d - 1] = weighted_median(std::move(start));
  for (int round = 0; round < 100; ++round) {
    const Eigen::VectorXd residual = y - x * beta;
    // |r| = r^2 / |r|; the floor of 1 mm keeps the weights finite.
    const Eigen::VectorXd weight = w.array() / residual.array().abs().max(1e-3);
    Eigen::MatrixXd normal = x.transpose() * weight.asDiagonal() * x;
    for (Eigen::Index j = 0; j + 1 < d; ++j)
      normal(j, j) += l1_penalty * w.sum() / std::max(std::abs(beta[j]), 1e-3);
    normal(d - 1, d - 1) += 1e-9;
    const Eigen::VectorXd next = normal.ldlt().solve(x.transpose() * weight.cwiseProduct(y));
    const double moved = (next - beta).cwiseAbs().maxCoeff();
    beta = next;
    if (moved < 1e-7) break;
  }
  return to_linear(beta);
}

}  // namespace anchord::ml
