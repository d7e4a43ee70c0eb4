#pragma once

#include <cstdint>

namespace anchord {

/// How the minimum is searched (dissertation section 7.2.4). All end at the same place on a well-posed
/// problem.
enum class Method : std::uint8_t { gauss_newton, levenberg_marquardt, dogleg };

/// What one range counts.
enum class Weights : std::uint8_t {
  inverse_variance,  ///< 1 / (sigma_pos^2 + sigma_d^2): the maximum-likelihood choice
  as_printed,        ///< eq 7.11: 1 / sqrt(sigma_pos^2 + sigma_d^2)
};

/// What a large residual counts; the argument is the residual over its sigma.
enum class Loss : std::uint8_t { none, huber, cauchy, tukey };

enum class Dims : std::uint8_t {
  two,  ///< height held at the start's
  three,
};

}  // namespace anchord
