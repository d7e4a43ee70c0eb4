// The part of a live anchor that refines a joint solution; the own search is in live_anchor.cpp.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/localize/error_ellipse.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/live_anchor.hpp"
#include "core/localize/range_block.hpp"

namespace anchord {
namespace {

constexpr double k_smallest_scale_m = 0.03;  // of the residuals; what the radio's clock alone makes

// The range curve of flight_solver.hpp.
double curve_shape(double distance_m) { return std::log(std::max(distance_m, 5.0) / 5.0); }

}  // namespace

void LiveAnchor::forgive(const std::string& why) {
  const auto it = estimate_.refused.find(why);
  if (it != estimate_.refused.end() && --it->second == 0) estimate_.refused.erase(it);
}

double LiveAnchor::correction_m(double distance_m, const LiveOptions& options) const {
  if (joint_) return joint_->bias_m + joint_->curve_m * curve_shape(distance_m);
  return position_m_ ? bias_m_ : options.bias_m;
}

bool LiveAnchor::adopt(const AnchorSolution& solution, const SharedSolution& shared, UtcTime cut) {
  const Estimate& estimate = solution.estimate;
  std::erase_if(recent_, [&](const Recent& recent) { return recent.time <= cut; });
  joint_.reset();
  estimate_.gates.clear();  // of an answer that no longer counts
  estimate_.largest_part.clear();
  const Eigen::Matrix3d information = solution.fit_covariance_m2.inverse();
  if (!estimate.best || !information.allFinite() || solution.fit_covariance_m2.trace() <= 0) return false;
  Joint joint;
  joint.estimate = estimate;
  joint.information_per_m2 = information;
  joint.floor_m2 = estimate.best->covariance_m2 - solution.fit_covariance_m2;
  joint.bias_m = shared.bias_m.value + solution.delay_m.value_or(0.0);
  joint.curve_m = shared.curve_m.value;
  joint.scale_m = std::max(solution.residual_scale_m, k_smallest_scale_m);
  if (first_ && newest_) {
    const double span_s = std::max(seconds_between(*first_, *newest_), 1.0);
    joint.rows_per_look = std::max(2.0 * k_error_correlation_s * static_cast<double>(used_) / span_s, 1.0);
  }
  joint_ = std::move(joint);
  refine();
  return true;
}

void LiveAnchor::refine() {
  const Joint& joint = *joint_;
  const Eigen::Vector3d before = joint.estimate.best->position.m;
  Eigen::Vector3d at = before;
  std::vector<Observation> rows;
  rows.reserve(recent_.size());
  for (const Recent& recent : recent_) {
    rows.push_back(recent.row);
    rows.back().distance_m -= joint.bias_m + joint.curve_m * curve_shape(recent.row.distance_m);
    rows.back().sigma_m = joint.scale_m;
  }
  RangeBlock block(rows);
  Eigen::Matrix3d information = joint.information_per_m2;
  // Three steps: the start is within centimetres.
  for (int step = 0; step < 3; ++step) {
    Unknowns place;
    place << at, 0.0;
    block.scale(place, Weights::inverse_variance);
    const RangeNormal sums = block.normal(place, Loss::cauchy, 2.0);
    information = joint.information_per_m2 + sums.matrix.topLeftCorner<3, 3>() / joint.rows_per_look;
    const Eigen::Vector3d gradient =
        joint.information_per_m2 * (before - at) + sums.gradient.head<3>() / joint.rows_per_look;
    at += information.inverse() * gradient;
  }
  Estimate answer = joint.estimate;
  answer.refused = estimate_.refused;
  answer.n_used = std::max(used_, answer.n_used);
  answer.time = newest_ ? std::max(*newest_, answer.time) : answer.time;
  const Eigen::Matrix3d covariance = information.inverse() + joint.floor_m2;
  if (at.allFinite() && covariance.allFinite()) {
    answer.best->position.m = at;
    answer.best->covariance_m2 = covariance;
    const ErrorEllipse ellipse = error_ellipse(covariance);
    answer.h95_m = ellipse.h95_m;
    answer.v95_m = ellipse.v95_m;
  }
  position_m_ = answer.best->position.m;
  estimate_ = std::move(answer);
}

}  // namespace anchord
