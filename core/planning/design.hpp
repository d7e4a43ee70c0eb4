#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/planning/flight_plan.hpp"

namespace anchord::planning {

/// Expected covariance of position and bias of many assumed anchors, under a set of measuring points that
/// changes.
class Design {
 public:
  Design(std::span<const Eigen::Vector3d> anchors, const FlightPlanOptions& options);

  void add(const Eigen::Vector3d& point);
  void remove(const Eigen::Vector3d& point);  ///< one that was added
  /// Of the criterion, summed over the anchors; lower is better.
  double value() const;
  double value_with(const Eigen::Vector3d& point) const;
  double mean_variance_m2() const;
  std::vector<double> sigmas_m() const;

 private:
  Eigen::Vector4d row(std::size_t anchor, const Eigen::Vector3d& point) const;
  void update(const Eigen::Vector3d& point, double sign);
  double value_of(const Eigen::Matrix4d& covariance) const;

  std::vector<Eigen::Vector3d> anchors_;
  std::vector<Eigen::Matrix4d> covariances_;
  FlightPlanOptions options_;
  double variance_m2_;  ///< of the mean of the ranges of one point
};

}  // namespace anchord::planning
