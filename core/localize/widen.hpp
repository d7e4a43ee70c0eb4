#pragma once

#include <Eigen/Core>

#include "core/localize/solver_options.hpp"

namespace anchord {

/// Lets one sigma of a covariance (position and delay of an anchor, m^2), in the direction of the move, be at
/// least the move. What is claimed already for other reasons is not claimed twice. Nothing where the move is
/// not finite.
/// moved  position and delay, metres; in the plane (Dims::two) its height counts for nothing
void reach(const Eigen::Vector4d& moved, Dims dims, Eigen::Matrix4d& covariance_m2);

/// Lets one sigma of the position be at least `sigma_m` in every horizontal direction.
void widen_in_plane(double sigma_m, Eigen::Matrix4d& covariance_m2);

/// Lets the covariance of the position be in no direction smaller than `least_m2`, which it then is in those
/// where it was. Nothing where that is not finite.
void hold(const Eigen::Matrix3d& least_m2, Dims dims, Eigen::Matrix4d& covariance_m2);

/// Did the position become less certain by a tenth or more (root of the trace)?
bool much_wider(const Eigen::Matrix4d& now_m2, const Eigen::Matrix4d& before_m2, Dims dims);

}  // namespace anchord
