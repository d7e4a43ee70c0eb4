#pragma once

#include <cstdint>

#include "core/base/enum_table.hpp"

namespace anchord {

/// How the minimum is searched (dissertation section 7.2.4). All end at the same place on a well-posed
/// problem.
enum class Method : std::uint8_t { gauss_newton, levenberg_marquardt, dogleg };
inline constexpr auto k_solver_words =
    enum_table<Method>({{"gauss_newton", Method::gauss_newton},
                        {"levenberg_marquardt", Method::levenberg_marquardt},
                        {"dogleg", Method::dogleg}});

/// What one range counts.
enum class Weights : std::uint8_t {
  inverse_variance,  ///< 1 / (sigma_pos^2 + sigma_d^2): the maximum-likelihood choice
  as_printed,        ///< eq 7.11: 1 / sqrt(sigma_pos^2 + sigma_d^2)
};
inline constexpr auto k_weights_words = enum_table<Weights>(
    {{"inverse_variance", Weights::inverse_variance}, {"dissertation", Weights::as_printed}});

/// What a large residual counts; the argument is the residual over its sigma.
enum class Loss : std::uint8_t { none, huber, cauchy, tukey };
inline constexpr auto k_loss_words = enum_table<Loss>(
    {{"none", Loss::none}, {"huber", Loss::huber}, {"cauchy", Loss::cauchy}, {"tukey", Loss::tukey}});

enum class Dims : std::uint8_t {
  two,  ///< height held at the start's
  three,
};

}  // namespace anchord
