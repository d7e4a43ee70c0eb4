#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace anchord::sim {

/// What the tag knows of one anchor when it computes its own position.
struct AnchorRange {
  Eigen::Vector3d at_m{0, 0, 0};
  double range_m{};
};

struct TagPosition {
  Eigen::Vector3d at_m{0, 0, 0};
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
};

/// The tag's own positioning: damped Gauss-Newton over equally weighted ranges, from below and above the
/// middle of the anchors. The firmware's method is not published; this one stands for any.
///
/// solve_z   false: the height is height_m and only the plane is searched
/// returns   nothing below three anchors (four with the height), or where they do not determine it
std::optional<TagPosition> tag_position(std::span<const AnchorRange> anchors, bool solve_z, double height_m);

/// The tag's filter of its positions, register 14. The register text names the kinds and says that a position
/// is late by as many samples as the strength: so the window has twice as many and one. The weights of the
/// low-pass are not published; here they fall linearly to both ends of the window.
///
/// newest_last  at least one; fewer than the window holds: all of them
/// setting      low nibble 0 none, 1 low-pass (FIR), 3 moving average, 4 moving median; high nibble strength.
///              Other kinds do nothing.
Eigen::Vector3d filter_position(std::span<const Eigen::Vector3d> newest_last, unsigned setting);
inline constexpr std::size_t k_longest_filter = 31;

}  // namespace anchord::sim
