#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace anchord {

/// Cholesky factor L of a symmetric positive definite matrix of some fifty rows, with eight columns B beside
/// it that become L^-1 B: all that a weighted fit asks of the errors of its rows. The same operations in the
/// same order whatever registers a machine has. Kept from one matrix to the next.
class ColumnFactor {
 public:
  static constexpr std::size_t n_beside = 8;
  using Beside = Eigen::Matrix<double, static_cast<int>(n_beside), 1>;
  using Products = Eigen::Matrix<double, static_cast<int>(n_beside), static_cast<int>(n_beside)>;

  explicit ColumnFactor(std::size_t n);

  /// Entries from one column to the next; columns begin with a whole group of four.
  std::size_t stride() const { return padded_; }
  /// Factors a * A + b * B + the diagonal.
  /// first, second  of `stride` entries a column, of which the lower triangle counts
  /// beside         a row of B each
  void factor(double a, std::span<const double> first, double b, std::span<const double> second,
              std::span<const double> diagonal, std::span<const Beside> beside);
  /// Sum of the logarithms of L's diagonal.
  double log_diagonal() const;
  /// (L^-1 B)^T (L^-1 B)
  Products products() const;

 private:
  std::size_t n_, padded_, length_;
  std::vector<double> columns_;  ///< of L, and under each what stands beside
};

}  // namespace anchord
