#pragma once

#include <Eigen/Core>

namespace anchord {

/// Positive where b is counterclockwise of a.
inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace anchord
