#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/localize/observation.hpp"
#include "core/localize/residual.hpp"

namespace anchord {

/// Normal equations of the ranges to one anchor, of all four unknowns, without prior.
struct RangeNormal {
  Eigen::Matrix4d matrix{Eigen::Matrix4d::Zero()};  ///< eq 7.26 with the robust weight on W: never indefinite
  Eigen::Matrix4d curvature{Eigen::Matrix4d::Zero()};  ///< of the cost itself, far out perhaps indefinite
  Eigen::Vector4d gradient{Eigen::Vector4d::Zero()};
  double cost{};  ///< half the sum of rho
};

/// How the sums are made: the answer is the same to the last bit.
enum class Registers : std::uint8_t { any, widest };

/// The ranges of one solve, each of their numbers side by side, so that a step over them is arithmetic on
/// four at a time. The order of every sum is fixed, whatever registers a machine has.
class RangeBlock {
 public:
  explicit RangeBlock(std::span<const Observation> observations);
  /// Takes sigmas and factors of row_scales() at a place.
  void scale(const Unknowns& at, Weights weights);
  /// No sigma changes with the place: once is enough.
  bool one_scale() const { return one_scale_; }
  /// At a place, with the scales of the last scale(). bend: sigmas where the loss bends.
  RangeNormal normal(const Unknowns& at, Loss loss, double bend,
                     Registers registers = Registers::widest) const;
  /// Range less what is predicted at a place, in the order of the observations.
  std::vector<double> residuals_m(const Unknowns& at) const;
  std::span<const Observation> observations() const { return observations_; }
  /// Whether all observations were found usable: whoever solves them from several places asks once.
  bool checked() const { return checked_; }
  void set_checked() { checked_ = true; }

 private:
  std::span<const Observation> observations_;
  std::vector<double> x_m_, y_m_, z_m_, distance_m_;  ///< of the tag; padded to whole groups
  std::vector<double> sigma2_m2_;
  std::array<std::vector<double>, 6> covariance_m2_;  ///< ee, en, eu, nn, nu, uu of the tag; empty: a ball's
  std::vector<double> inverse_sigma_, factor2_;       ///< 0 in the padding, where a row then weighs nothing
  bool one_scale_{true}, one_factor_{true}, checked_{false};
  std::optional<Weights> scaled_{};
};

}  // namespace anchord
