#include "core/localize/column_factor.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

namespace anchord::column_factor_test {
namespace {

/// Errors alike as far as the rows are near each other, and some of their own.
Eigen::MatrixXd alike(Eigen::Index n, double length) {
  Eigen::MatrixXd out(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) out(i, j) = std::exp(-std::abs(static_cast<double>(i - j)) / length);
  return out;
}

/// The lower triangle as ColumnFactor wants it; what is above is not looked at.
std::vector<double> columns_of(const Eigen::MatrixXd& matrix, std::size_t stride) {
  const auto n = static_cast<std::size_t>(matrix.rows());
  std::vector<double> out(n * stride);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = j; i < n; ++i)
      out[j * stride + i] = matrix(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  return out;
}

TEST(ColumnFactor, SaysOfAFitWhatEigenSays) {
  for (const Eigen::Index n : {1, 2, 3, 4, 5, 12, 16, 17, 31, 50, 51}) {
    const Eigen::MatrixXd first = alike(n, 7.5), second = alike(n, 2.0);
    Eigen::VectorXd diagonal(n);
    Eigen::Matrix<double, Eigen::Dynamic, 8> beside(n, 8);
    std::vector<ColumnFactor::Beside> rows;
    for (Eigen::Index i = 0; i < n; ++i) {
      diagonal[i] = 0.01 + 0.001 * static_cast<double>(i % 5);
      for (Eigen::Index k = 0; k < 8; ++k) beside(i, k) = std::sin(static_cast<double>(3 * i + 5 * k));
      rows.emplace_back(beside.row(i).transpose());
    }
    ColumnFactor factor(static_cast<std::size_t>(n));
    const auto one = columns_of(first, factor.stride()), other = columns_of(second, factor.stride());
    // The second time over what the first has left.
    for (const double b : {0.0, 0.4}) {
      const double a = 0.09;
      factor.factor(a, one, b, other, {diagonal.data(), static_cast<std::size_t>(n)}, rows);
      Eigen::MatrixXd whole = a * first + b * second;
      whole.diagonal() += diagonal;
      const Eigen::Matrix<double, 8, 8> expected = beside.transpose() * whole.inverse() * beside;
      EXPECT_LT((factor.products() - expected).cwiseAbs().maxCoeff(), 1e-10 * expected.norm()) << n;
      EXPECT_NEAR(factor.log_diagonal(), 0.5 * std::log(whole.determinant()), 1e-9) << n;
    }
  }
}

}  // namespace
}  // namespace anchord::column_factor_test
