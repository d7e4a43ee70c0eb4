#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/localize/observation.hpp"

namespace anchord {

/// What tells an anchor from its mirror solution on the other side of the wall, or above from below. Each is
/// a prior with a sigma of its own; any may be absent.
struct AnchorPriors {
  struct Bearing {
    Eigen::Vector3d tag_m{0, 0, 0};  ///< where the aircraft turned, ENU or local metres
    double bearing_rad{};            ///< of the anchor from there, clockwise from north (the y axis)
    double sigma_rad{0.35};          ///< 20 degrees, section 8.3.5
  };
  std::optional<Bearing> bearing{};
  struct Height {
    double up_m{};        ///< of the anchor, as the height search found it
    double sigma_m{1.0};  ///< chosen: the search stops where RSS is highest, to about a storey's third
  };
  std::optional<Height> height{};
};

/// Level of the signal over the orientation of the aircraft: the two lobes of Fig 8.4.
struct LevelSample {
  Eigen::Vector3d tag_m{0, 0, 0};
  double heading_rad{};  ///< clockwise from north (the y axis)
  double rss_dbm{};
};

/// What one prior asks of a place: `missing` sigmas along `slope` (sigmas per metre). Zero where it asks
/// nothing. Bearing, height, outline.
struct PriorRow {
  Eigen::Vector3d slope{0, 0, 0};
  double missing{};
};
std::array<PriorRow, 3> prior_rows(const AnchorPriors& priors, std::span<const Eigen::Vector2d> outline_m,
                                   double outline_sigma_m, const Eigen::Vector3d& place_m);

/// Half the squared misfit of a place, in sigmas: differences between two places are log odds.
/// outline_m  corners of the building, ENU or local metres, empty for none: anchors are inside, and each
/// metre
///            outside costs as the sigma says
double prior_cost(const AnchorPriors& priors, std::span<const Eigen::Vector2d> outline_m,
                  double outline_sigma_m, const Eigen::Vector3d& place_m);

/// Metres a place is outside of the outline; 0 within it, and without one.
double outside_outline_m(std::span<const Eigen::Vector2d> outline_m, const Eigen::Vector3d& place_m);

/// Levels against the turn profile seen from a place, free space and level offset fitted: half the sum of
/// squares over sigma^2. Samples of one flight are alike for seconds: divide by how many say the same.
/// 0 for fewer than 30 samples or less than a quarter turn of headings.
double level_cost(std::span<const LevelSample> samples, const Eigen::Vector3d& place_m, double sigma_db);

/// The same as Gaussian rows at a place: information and gradient to add to its normal equations.
struct PriorNormal {
  Eigen::Matrix3d information{Eigen::Matrix3d::Zero()};
  Eigen::Vector3d gradient{Eigen::Vector3d::Zero()};
};
PriorNormal prior_normal(const AnchorPriors& priors, std::span<const Eigen::Vector2d> outline_m,
                         double outline_sigma_m, const Eigen::Vector3d& place_m);

}  // namespace anchord
