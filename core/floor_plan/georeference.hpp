#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"

namespace anchord::floor_plan {

/// A place known on the plan and on the ground.
/// pixel  (0, 0) is the upper left corner of the upper left pixel, x to the right, y down
struct PixelPair {
  std::string name;
  Eigen::Vector2d pixel{0, 0};
  Eigen::Vector2d enu_m{0, 0};
};

enum class FitModel : std::uint8_t {
  helmert,  ///< 4 parameters: shift, turn, one scale; for plans drawn to scale
  affine,   ///< 6 parameters: each axis its own scale and direction; for scans and photographs
};
inline constexpr auto k_fit_model_words =
    enum_table<FitModel>({{"helmert", FitModel::helmert}, {"affine", FitModel::affine}});

/// enu = shift + linear * pixel. The pixel's y axis points down: a plan that is not mirrored has a negative
/// determinant.
struct PlanTransform {
  Eigen::Matrix2d linear{Eigen::Vector2d(1, -1).asDiagonal()};  ///< metres per pixel
  Eigen::Vector2d shift_m{0, 0};

  Eigen::Vector2d enu_from(const Eigen::Vector2d& pixel) const { return shift_m + linear * pixel; }
  Eigen::Vector2d pixel_from(const Eigen::Vector2d& enu_m) const;
  double scale_m_per_px() const;  ///< root of the area of a pixel
  double turn_deg() const;        ///< from east to the plan's x axis, counter-clockwise, (-180, 180]
};

struct PairResidual {
  Eigen::Vector2d residual_m{0, 0};  ///< given minus fitted, ENU
  /// Given minus predicted by the other pairs alone; absent where they do not determine a fit.
  std::optional<Eigen::Vector2d> left_out_m{};
};

struct PlanFit {
  PlanTransform transform;
  FitModel model{FitModel::helmert};
  std::vector<PairResidual> residuals;  ///< in the order of the pairs
  double rms_m{};                       ///< of the residuals, per pair
  int redundancy{};                     ///< coordinates beyond those the model needs
  std::optional<std::size_t> wrong{};   ///< the one pair that does not fit the others
  std::vector<std::string> notes;       ///< for people: what is wrong, or why that cannot be known
};

struct PlanFitOptions {
  FitModel model{FitModel::helmert};
  /// How well a careful click on a plan and the same corner on a map agree; what lies within twice of it is
  /// not called wrong.
  double agreement_m = 0.25;
  /// Metres per pixel as known from elsewhere, e.g. from the length of one wall. With it even three pairs
  /// show which one is wrong.
  std::optional<double> known_scale_m_per_px{};
  double scale_agreement = 0.01;  ///< a known scale counts as met within this share
};

/// Least-squares transform from the pixels of a plan to ENU metres, all pairs alike.
///
/// Which pair is wrong: each is left out in turn. A pair is named where it misses the fit of the others by
/// more than 2 * agreement_m and 3 times their own rms, and where leaving out any other pair explains the
/// residuals less than half as well. That needs a redundancy of 3 or more: one wrong pair has two unknown
/// coordinates, so that with redundancy 2 (helmert of 3 pairs, affine of 4) leaving out *any* pair makes the
/// others fit exactly, and which one would have to move least depends on where the pairs lie, not on what was
/// clicked. There a known scale decides: the pair is named whose removal alone leaves the others at that
/// scale.
///
/// errors   too_few_observations (helmert: 2 pairs, affine: 3), weak_geometry (one place, affine: one line),
///          invalid_argument (not finite)
/// accuracy exact pairs come back within 1e-9 of their extent (georeference_test.cpp)
/// threads  pure
Result<PlanFit> fit_plan(std::span<const PixelPair> pairs, const PlanFitOptions& options = {});

}  // namespace anchord::floor_plan
