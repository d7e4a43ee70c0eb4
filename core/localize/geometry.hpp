#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>

#include "core/localize/observation.hpp"
#include "core/localize/solver_options.hpp"

namespace anchord {

/// Where the tag was, as an ellipsoid: standard deviations along the principal axes, ascending.
struct TrackShape {
  Eigen::Vector3d centroid_m{0, 0, 0};
  Eigen::Matrix3d axes{Eigen::Matrix3d::Identity()};  ///< columns; column 0 is normal to the flattest plane
  Eigen::Vector3d sd_m{0, 0, 0};
  /// Reflection through the flattest plane: the mirror solution that fits ranges from one plane as well.
  Eigen::Vector3d mirrored(const Eigen::Vector3d& point_m) const;
};
TrackShape track_shape(std::span<const Observation> observations);

enum class GeometryKind : std::uint8_t { too_few, collinear, coplanar, good };

/// Limits on the shape of the track seen from the anchor, D = median range. Each lies between real flights
/// that failed and passed: line 0.05 failed, 0.075 passed; planes 0.002 to 0.015 had a mirror solution, 0.055
/// had none.
struct GeometryLimits {
  double line{0.07};  ///< L2/D below: a line
  double line_marginal{0.10};
  double plane{0.02};  ///< L1/D below: a plane
};

struct GeometryReport {
  GeometryKind kind{GeometryKind::too_few};
  TrackShape shape;
  double median_range_m{};
  double line_ratio{};   ///< L2/D
  double plane_ratio{};  ///< L1/D
  std::string reason;    ///< with the numbers; empty when good
};

/// May these ranges determine an anchor at all? Asked before any solver, which would answer a number
/// regardless. In 2D the height is not asked for: coplanar is good then, and a line leaves the mirror
/// solution across it.
GeometryReport assess_geometry(std::span<const Observation> observations, Dims dims = Dims::three,
                               const GeometryLimits& limits = {});

}  // namespace anchord
