#include "core/planning/information.hpp"

#include <Eigen/LU>
#include <cmath>

namespace anchord::planning {
namespace {

constexpr double k_pinned_m2 = 1e-12;  // a micrometre: "not estimated"

Eigen::Matrix4d updated(const Eigen::Matrix4d& p, const Eigen::Vector4d& h, double weight) {
  const Eigen::Vector4d ph = p * h;
  return p - ph * ph.transpose() / (1 / weight + h.dot(ph));
}

}  // namespace

Information::Information(const Eigen::Vector3d& place_m, const std::optional<Eigen::Matrix3d>& prior_m2,
                         const NextPointOptions& options)
    : place_m_(place_m), options_(options), covariance_(Eigen::Matrix4d::Zero()) {
  const double weak = options.prior_sigma_m * options.prior_sigma_m;
  covariance_.topLeftCorner<3, 3>() = prior_m2 ? *prior_m2 : (Eigen::Matrix3d::Identity() * weak).eval();
  if (options.dims == 2) {
    covariance_.row(2).setZero();
    covariance_.col(2).setZero();
    covariance_(2, 2) = k_pinned_m2;
  }
  covariance_(3, 3) = options.bias_column ? options.bias_sigma_m * options.bias_sigma_m : k_pinned_m2;
}

Eigen::Vector4d Information::row(const Eigen::Vector3d& point_m) const {
  Eigen::Vector3d d = point_m - place_m_;
  if (options_.dims == 2) d.z() = 0;
  const double length = d.norm();
  Eigen::Vector4d h = Eigen::Vector4d::Zero();
  if (!(length > 1e-6)) return h;  // no direction, no information
  h.head<3>() = d / length;
  h[3] = options_.bias_column ? 1 : 0;
  return h;
}

double Information::weight(double p_nlos) const {
  const double track = options_.position_sigma_m * options_.position_sigma_m;
  const double los = options_.los_sigma_m * options_.los_sigma_m + track;
  const double nlos = options_.nlos_sigma_m * options_.nlos_sigma_m + track;
  return (1 - p_nlos) / los + p_nlos / nlos;
}

double Information::value(const Eigen::Matrix4d& covariance) const {
  if (options_.rule == Rule::a_optimal) return covariance.topLeftCorner<3, 3>().trace();
  const double det = options_.dims == 2 ? covariance.topLeftCorner<2, 2>().determinant()
                                        : covariance.topLeftCorner<3, 3>().determinant();
  return det > 0 ? std::log(det) : -INFINITY;
}

void Information::add(const Eigen::Vector3d& point_m, double p_nlos) {
  covariance_ = updated(covariance_, row(point_m), weight(p_nlos));
}

double Information::with(const Eigen::Vector3d& point_m, double p_nlos) const {
  return value(updated(covariance_, row(point_m), weight(p_nlos)));
}

double Information::now() const { return value(covariance_); }

}  // namespace anchord::planning
