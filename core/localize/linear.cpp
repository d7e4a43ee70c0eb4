#include "core/localize/linear.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "core/localize/geometry.hpp"

namespace anchord {
namespace {

bool finite(const Observation& o) { return o.tag_m.allFinite() && std::isfinite(o.distance_m); }

/// Both (or the one) solutions of the centred linear system in principal axes.
void centred_solutions(std::span<const Observation> observations, Dims dims,
                       std::vector<Eigen::Vector3d>& out) {
  if (observations.size() < 3) return;
  const TrackShape shape = track_shape(observations);
  const double n = static_cast<double>(observations.size());
  Eigen::Vector3d rhs =
      Eigen::Vector3d::Zero();  // sum of local * (|local|^2 - r^2), eq 7.2-7.3 about the mean
  double mean_q = 0;
  for (const auto& o : observations) {
    const Eigen::Vector3d local = shape.axes.transpose() * (o.tag_m - shape.centroid_m);
    mean_q += (local.squaredNorm() - o.distance_m * o.distance_m) / n;
    rhs += local * (local.squaredNorm() - o.distance_m * o.distance_m);
  }
  // 2 C x = rhs with C = n diag(sd^2): the axes are principal, so the system is diagonal.
  Eigen::Vector3d local_anchor = Eigen::Vector3d::Zero();
  const double widest_m = shape.sd_m.z();
  if (widest_m <= 0) return;
  int flat_axis = -1;
  double inside_m2 = 0;
  for (int axis = 2; axis >= 0; --axis) {
    const bool flat = shape.sd_m[axis] < 0.02 * widest_m || (axis == 0 && dims == Dims::two);
    if (flat) {
      flat_axis = axis;
      continue;
    }
    local_anchor[axis] = rhs[axis] / (2.0 * n * shape.sd_m[axis] * shape.sd_m[axis]);
    inside_m2 += local_anchor[axis] * local_anchor[axis];
  }
  const auto global = [&](const Eigen::Vector3d& local) { return shape.centroid_m + shape.axes * local; };
  out.push_back(global(local_anchor));
  // mean(r^2 - |p|^2) = |x|^2: what the solved axes leave is the size of the flat one, not its sign. For a
  // track that is flat only nearly, the same size is a better guess than the ill-conditioned axis itself.
  const int weak_axis = flat_axis >= 0 ? flat_axis : 0;
  if (flat_axis < 0) inside_m2 -= local_anchor[0] * local_anchor[0];
  const double size_m = std::sqrt(std::max(-mean_q - inside_m2, 0.0));
  for (const double sign : {1.0, -1.0}) {
    Eigen::Vector3d mirror = local_anchor;
    mirror[weak_axis] = sign * size_m;
    out.push_back(global(mirror));
  }
}

}  // namespace

Result<Eigen::Vector3d> linear_position(std::span<const Observation> observations, Dims dims) {
  const Eigen::Index d = dims == Dims::two ? 2 : 3;
  const auto n = static_cast<Eigen::Index>(observations.size());
  if (!std::ranges::all_of(observations, finite)) {
    return make_error(Errc::invalid_argument, "an observation is not finite");
  }
  if (n < d + 1) {
    return make_error(Errc::too_few_observations,
                      std::to_string(n) + " ranges, need " + std::to_string(d + 1));
  }
  Eigen::MatrixXd a(n - 1, d);
  Eigen::VectorXd b(n - 1);
  const Observation& last = observations.back();
  double mean_z_m = 0;
  for (const auto& o : observations) mean_z_m += o.tag_m.z() / static_cast<double>(n);
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    const Observation& o = observations[static_cast<std::size_t>(i)];
    // x_i^2 - x_n^2 as (x_i - x_n)(x_i + x_n): the squares of large coordinates would cancel.
    const Eigen::VectorXd difference = (o.tag_m - last.tag_m).head(d);
    a.row(i) = 2.0 * difference.transpose();
    b(i) = difference.dot((o.tag_m - last.tag_m).head(d)) + last.distance_m * last.distance_m -
           o.distance_m * o.distance_m;
  }
  // b above is eq 7.3 with the last point as origin, so the answer is relative to it.
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(a);
  if (qr.rank() < d) {
    return make_error(Errc::weak_geometry, "the tag positions span " + std::to_string(qr.rank()) +
                                               " dimensions, need " + std::to_string(d));
  }
  Eigen::Vector3d anchor(0, 0, mean_z_m);
  anchor.head(d) = qr.solve(b) + last.tag_m.head(d);
  return anchor;
}

std::vector<Eigen::Vector3d> start_candidates(std::span<const Observation> observations, Dims dims) {
  std::vector<Observation> rows;
  std::ranges::copy_if(observations, std::back_inserter(rows), finite);
  std::vector<Eigen::Vector3d> starts;
  if (rows.empty()) return starts;
  centred_solutions(rows, dims, starts);
  // The nearest third: late ranges from far away pull the linear system most.
  std::ranges::sort(rows, {}, &Observation::distance_m);
  const std::size_t near =
      std::max<std::size_t>(rows.size() * 35 / 100, std::min<std::size_t>(rows.size(), 8));
  centred_solutions(std::span(rows).first(near), dims, starts);
  const TrackShape shape = track_shape(rows);
  const std::size_t solved = starts.size();
  for (std::size_t i = 0; i < solved; ++i) starts.push_back(shape.mirrored(starts[i]));
  starts.push_back(rows.front().tag_m + Eigen::Vector3d(0, 0, 0.5));
  const double radius_m = 0.7 * rows[rows.size() / 2].distance_m;
  for (int k = 0; k < 6; ++k) {
    const double azimuth = k * std::numbers::pi / 3.0;
    for (const double up : {0.5, -0.5}) {
      starts.push_back(shape.centroid_m +
                       radius_m * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), up));
    }
  }
  return starts;
}

}  // namespace anchord
