#include "core/localize/column_factor.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/localize/lanes.hpp"

namespace anchord {
namespace {

using namespace lanes;

struct Columns {
  double* begin;
  std::size_t n, length;
};

/// Takes the columns before `j` off `groups` groups of its rows, which stay in registers.
template <std::size_t groups>
ANCHORD_INLINE void reduce(const Columns& columns, std::size_t j, std::size_t row) {
  double* const to = columns.begin + j * columns.length + row;
  std::array<Four, groups> left;
  for (std::size_t g = 0; g < groups; ++g) left[g] = load(to + g * k_lanes);
  for (std::size_t k = 0; k < j; ++k) {
    const double* const column = columns.begin + k * columns.length;
    for (std::size_t g = 0; g < groups; ++g) left[g] -= column[j] * load(column + row + g * k_lanes);
  }
  for (std::size_t g = 0; g < groups; ++g) store(to + g * k_lanes, left[g]);
}

ANCHORD_INLINE void factor_columns(const Columns& columns) {
  constexpr std::size_t k_many = 4;
  for (std::size_t j = 0; j < columns.n; ++j) {
    const std::size_t first = j / k_lanes * k_lanes;
    std::size_t row = first;
    for (; row + k_many * k_lanes <= columns.length; row += k_many * k_lanes) reduce<k_many>(columns, j, row);
    for (; row < columns.length; row += k_lanes) reduce<1>(columns, j, row);
    double* const column = columns.begin + j * columns.length;
    const double root = __builtin_sqrt(column[j]), inverse = 1.0 / root;
    for (row = first; row < columns.length; row += k_lanes) store(column + row, inverse * load(column + row));
    column[j] = root;
  }
}

void factor_plain(const Columns& columns) { factor_columns(columns); }
#if defined(__x86_64__)
__attribute__((target("avx2"))) void factor_avx2(const Columns& columns) { factor_columns(columns); }
const bool k_wide = __builtin_cpu_supports("avx2") != 0;
#else
constexpr bool k_wide = false;
constexpr auto factor_avx2 = factor_plain;
#endif

}  // namespace

ColumnFactor::ColumnFactor(std::size_t n)
    : n_(n),
      padded_((n + k_lanes - 1) / k_lanes * k_lanes),
      length_(padded_ + n_beside),
      columns_(n * length_) {}

void ColumnFactor::factor(double a, std::span<const double> first, double b, std::span<const double> second,
                          std::span<const double> diagonal, std::span<const Beside> beside) {
  for (std::size_t j = 0; j < n_; ++j) {
    double* const to = columns_.data() + j * length_;
    const double *const one = first.data() + j * padded_, *const other = second.data() + j * padded_;
    // What is above the diagonal in its group is a number, and does not count.
    for (std::size_t i = j / k_lanes * k_lanes; i < padded_; ++i) to[i] = a * one[i] + b * other[i];
    to[j] += diagonal[j];
    std::copy_n(beside[j].data(), n_beside, to + padded_);
  }
  (k_wide ? factor_avx2 : factor_plain)({columns_.data(), n_, length_});
}

double ColumnFactor::log_diagonal() const {
  // One logarithm of a product of a few, which no size of a standard deviation takes out of the numbers.
  constexpr std::size_t k_few = 8;
  double sum = 0;
  for (std::size_t j = 0; j < n_; j += k_few) {
    double product = 1.0;
    for (std::size_t k = j; k < std::min(n_, j + k_few); ++k) product *= columns_[k * length_ + k];
    sum += std::log(product);
  }
  return sum;
}

ColumnFactor::Products ColumnFactor::products() const {
  Products out = Products::Zero();
  for (std::size_t j = 0; j < n_; ++j) {
    const Eigen::Map<const Beside> beside(columns_.data() + j * length_ + padded_);
    out.noalias() += beside * beside.transpose();
  }
  return out;
}

}  // namespace anchord
