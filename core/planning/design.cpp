#include "core/planning/design.hpp"

#include <Eigen/LU>
#include <cmath>

namespace anchord::planning {

Design::Design(std::span<const Eigen::Vector3d> anchors, const FlightPlanOptions& options)
    : anchors_(anchors.begin(), anchors.end()),
      options_(options),
      variance_m2_(options.range_sigma_m * options.range_sigma_m / options.ranges_per_point +
                   options.point_sigma_m * options.point_sigma_m) {
  const double prior = options.prior_sigma_m * options.prior_sigma_m;
  const Eigen::Vector4d diagonal{prior, prior, prior, options.bias_sigma_m * options.bias_sigma_m};
  covariances_.assign(anchors_.size(), diagonal.asDiagonal().toDenseMatrix());
}

Eigen::Vector4d Design::row(std::size_t anchor, const Eigen::Vector3d& point) const {
  const Eigen::Vector3d d = point - anchors_[anchor];
  const double length = d.norm();
  if (length > options_.max_range_m || length < 1e-6) return Eigen::Vector4d::Zero();
  return {d.x() / length, d.y() / length, d.z() / length, 1.0};
}

double Design::value_of(const Eigen::Matrix4d& covariance) const {
  if (options_.criterion == Criterion::a_optimal) return covariance.topLeftCorner<3, 3>().trace();
  return std::log(covariance.topLeftCorner<3, 3>().determinant());
}

void Design::update(const Eigen::Vector3d& point, double sign) {
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Eigen::Vector4d h = row(i, point), ph = covariances_[i] * h;
    covariances_[i] -= sign * ph * ph.transpose() / (variance_m2_ + sign * h.dot(ph));
  }
}

void Design::add(const Eigen::Vector3d& point) { update(point, 1); }
void Design::remove(const Eigen::Vector3d& point) { update(point, -1); }

double Design::value() const {
  double out = 0;
  for (const auto& covariance : covariances_) out += value_of(covariance);
  return out;
}

double Design::value_with(const Eigen::Vector3d& point) const {
  double out = 0;
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Eigen::Vector4d h = row(i, point), ph = covariances_[i] * h;
    if (options_.criterion == Criterion::a_optimal) {  // the trace alone needs no matrix
      out += covariances_[i].topLeftCorner<3, 3>().trace() -
             ph.head<3>().squaredNorm() / (variance_m2_ + h.dot(ph));
    } else {
      out += value_of(covariances_[i] - ph * ph.transpose() / (variance_m2_ + h.dot(ph)));
    }
  }
  return out;
}

double Design::mean_variance_m2() const {
  double out = 0;
  for (const auto& covariance : covariances_) out += covariance.topLeftCorner<3, 3>().trace();
  return out / static_cast<double>(covariances_.size());
}

std::vector<double> Design::sigmas_m() const {
  std::vector<double> out;
  for (const auto& covariance : covariances_)
    out.push_back(std::sqrt(covariance.topLeftCorner<3, 3>().trace()));
  return out;
}

}  // namespace anchord::planning
