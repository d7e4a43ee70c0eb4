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

}  // namespace anchord::sim
