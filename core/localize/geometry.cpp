#include "core/localize/geometry.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <vector>

#include "core/base/median.hpp"

namespace anchord {
namespace {

std::string mirror_sentence(const char* format, double a, double b, double c) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

}  // namespace

Eigen::Vector3d TrackShape::mirrored(const Eigen::Vector3d& point_m) const {
  const Eigen::Vector3d normal = axes.col(0);
  return point_m - 2.0 * normal.dot(point_m - centroid_m) * normal;
}

TrackShape track_shape(std::span<const Observation> observations) {
  TrackShape shape;
  if (observations.empty()) return shape;
  const double n = static_cast<double>(observations.size());
  for (const auto& o : observations) shape.centroid_m += o.tag_m / n;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& o : observations) {
    const Eigen::Vector3d d = o.tag_m - shape.centroid_m;
    scatter += d * d.transpose() / n;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  shape.sd_m = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  shape.axes = eigen.eigenvectors();
  return shape;
}

GeometryReport assess_geometry(std::span<const Observation> observations, Dims dims,
                               const GeometryLimits& limits) {
  GeometryReport report;
  const std::size_t needed = dims == Dims::two ? 3 : 4;
  std::vector<Observation> distinct;  // repeats of one place are one place
  for (const auto& o : observations) {
    if (!o.tag_m.allFinite() || !std::isfinite(o.distance_m)) continue;
    if (distinct.size() >= needed) break;
    const auto same = [&](const Observation& other) { return (other.tag_m - o.tag_m).norm() < 1e-3; };
    if (std::ranges::none_of(distinct, same)) distinct.push_back(o);
  }
  if (distinct.size() < needed) {
    report.reason =
        mirror_sentence("too few: ranges from %.0f distinct places, need %.0f (%.0f ranges in all)",
                        static_cast<double>(distinct.size()), static_cast<double>(needed),
                        static_cast<double>(observations.size()));
    return report;
  }
  const auto usable = [](const Observation& o) { return o.tag_m.allFinite() && std::isfinite(o.distance_m); };
  std::span<const Observation> rows = observations;
  std::vector<Observation> changed;
  if (dims == Dims::two || !std::ranges::all_of(observations, usable)) {
    std::ranges::copy_if(observations, std::back_inserter(changed), usable);
    if (dims == Dims::two) {
      for (auto& o : changed) o.tag_m.z() = 0;
    }
    rows = changed;
  }
  std::vector<double> range_m;
  range_m.reserve(rows.size());
  for (const auto& o : rows) range_m.push_back(o.distance_m);
  report.median_range_m = std::max(upper_median(range_m), 1e-3);
  report.shape = track_shape(rows);
  report.line_ratio = report.shape.sd_m.y() / report.median_range_m;
  report.plane_ratio = report.shape.sd_m.x() / report.median_range_m;
  if (report.line_ratio < limits.line) {
    report.kind = GeometryKind::collinear;
    report.reason = mirror_sentence(
        "weak geometry: the track is a line as seen from the anchor, %.2f m wide across at a median range of "
        "%.2f m (ratio %.3f)",
        report.shape.sd_m.y(), report.median_range_m, report.line_ratio);
  } else if (dims == Dims::three && report.plane_ratio < limits.plane) {
    report.kind = GeometryKind::coplanar;
    report.reason = mirror_sentence(
        "mirror: the track is a plane as seen from the anchor, %.2f m thick at a median range of %.2f m "
        "(ratio %.4f)",
        report.shape.sd_m.x(), report.median_range_m, report.plane_ratio);
  } else {
    report.kind = GeometryKind::good;
  }
  return report;
}

}  // namespace anchord
