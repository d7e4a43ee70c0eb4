#pragma once

#include <Eigen/Eigenvalues>

namespace anchord {

/// Eigenvalues, ascending, and eigenvectors of a symmetric matrix; of two rows in closed form, for which
/// Eigen's general way takes ten seconds to compile.
template <int N>
Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> axes_of(const Eigen::Matrix<double, N, N>& matrix,
                                                                   int options = Eigen::ComputeEigenvectors) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> out;
  if constexpr (N == 2)
    out.computeDirect(matrix, options);
  else
    out.compute(matrix, options);
  return out;
}

}  // namespace anchord
