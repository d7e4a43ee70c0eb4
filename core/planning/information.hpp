#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/planning/next_point.hpp"

namespace anchord::planning {

/// Expected covariance of one place of one anchor, and what one more range would make of it.
///
/// State: position (3, or 2 in the plane) and, with `bias_column`, a constant excess on every range. A range
/// adds w h h^T to the information, h = (unit vector, 1), w = expected 1/sigma^2; the covariance follows by
/// Sherman and Morrison, exact and without an inverse per candidate. Dimensions that are not estimated are
/// pinned by a prior of a micrometre, so that one fixed size serves all cases.
class Information {
 public:
  Information(const Eigen::Vector3d& place_m, const std::optional<Eigen::Matrix3d>& prior_m2,
              const NextPointOptions& options);

  void add(const Eigen::Vector3d& point_m, double p_nlos);
  /// Of the position: trace in m^2 (a_optimal) or log det (d_optimal); with one more range at the point.
  double with(const Eigen::Vector3d& point_m, double p_nlos) const;
  double now() const;

 private:
  Eigen::Vector4d row(const Eigen::Vector3d& point_m) const;
  double weight(double p_nlos) const;
  double value(const Eigen::Matrix4d& covariance) const;

  Eigen::Vector3d place_m_;
  NextPointOptions options_;
  Eigen::Matrix4d covariance_;
};

}  // namespace anchord::planning
