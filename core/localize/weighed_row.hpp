#pragma once

#include "core/localize/joint_model.hpp"

namespace anchord {

/// How one range counts in the normal equations of a fit. The likelihood of a model where one spoke.
struct WeighedRow {
  double per_m2{};      ///< robust weight, variance and tempering
  double residual_m{};  ///< that goes with it
};

/// line     of the row, at the solution
/// block    of its anchor
/// scale_m  of the anchor's residuals
WeighedRow weighed_row(const JointRow& row, const JointLine& line, const AnchorBlock& block, double scale_m,
                       const FlightOptions& options);

/// Scales beyond which a residual counts less where systematic errors are asked for: they make residuals
/// large, and rejected ranges would not show them.
inline constexpr double k_wide_scales = 3;

/// Variance that a residual is held against: the scale, and what the track adds to what it usually adds, m^2.
double row_variance_m2(const JointLine& line, const AnchorBlock& block, double scale_m);

/// Adds what is known of an anchor beside its ranges, delay and place, to its normal equations by (x, y, z,
/// d). returns  their inverse; in the plane the height takes no part
Eigen::Matrix4d add_anchor_priors(NetworkId id, const JointState::Anchor& anchor,
                                  const FlightOptions& options, Eigen::Matrix4d own,
                                  Eigen::Vector4d& gradient);

}  // namespace anchord
