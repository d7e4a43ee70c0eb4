#include "core/planning/design.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/base/cross.hpp"

namespace anchord::planning {
namespace {

constexpr double k_facade_m = 0.6;

/// Walls between two points, each by the inverse cosine: one of unknown make counts as one, an accepted one
/// by its excess in units of `unknown_m`, the roof as `roof` of them. Nothing where the accepted ones let
/// nothing through.
std::optional<double> slant_between(const Building& building, double roof, double unknown_m,
                                    const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Polygon& outline = building.outline;
  const auto hits = building.walls ? hits_between(*building.walls, from, to) : std::vector<WallHit>{};
  double accepted = 0, loss_db = 0;
  for (const WallHit& hit : hits) {
    accepted += unknown_m > 0 ? hit.excess_m / unknown_m : 0;
    loss_db += hit.loss_db;
  }
  if (loss_db > k_opaque_db) return std::nullopt;
  if (outline.size() < 3) return accepted;
  const Eigen::Vector3d way = to - from;
  const double length = way.norm();
  double out = 0;
  bool over = false;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Eigen::Vector2d &a = outline[i], edge = outline[(i + 1) % outline.size()] - a;
    const double across = cross(way.head<2>(), edge);
    if (std::abs(across) < 1e-12) continue;
    const Eigen::Vector2d begin = a - from.head<2>();
    const double share = cross(begin, edge) / across, along = cross(begin, way.head<2>()) / across;
    if (share <= 0 || share >= 1 || along < 0 || along >= 1) continue;
    if (from.z() + share * way.z() > building.height_m) {
      over = true;
      continue;
    }
    const double across_m = std::abs(across) / edge.norm();  // of the whole way, at right angles to the edge
    const bool known = std::any_of(hits.begin(), hits.end(), [&](const WallHit& hit) {
      return std::abs(hit.share - share) * across_m <= k_facade_m;
    });
    if (!known) out += wall_slant(across_m / length);
  }
  // In over the top of a wall means in through the roof.
  if (over) out += roof * wall_slant(std::abs(way.z()) / length);
  return out + accepted;
}

}  // namespace

Design::Design(std::span<const Eigen::Vector3d> anchors, const FlightPlanOptions& options,
               const Building& building)
    : anchors_(anchors.begin(), anchors.end()), options_(options), building_(building) {
  const double prior = options.prior_sigma_m * options.prior_sigma_m;
  const Eigen::Vector4d diagonal{prior, prior, prior, options.bias_sigma_m * options.bias_sigma_m};
  error_models_.assign(anchors_.size(), ErrorModel{diagonal.asDiagonal().toDenseMatrix()});
}

Sight Design::sight(const Eigen::Vector3d& point, const Eigen::Vector3d& anchor) const {
  Sight out;
  const Eigen::Vector3d d = point - anchor;
  const double length = d.norm();
  if (length > options_.max_range_m || length < 1e-6) return out;
  const auto slant = slant_between(building_, options_.roof_walls, options_.wall_excess_m, point, anchor);
  if (!slant) return out;
  out.row << d / length, 1.0;
  out.slant = *slant;
  // The spread of late paths grows as the excess does.
  const double noise_m = options_.range_sigma_m * std::max(1.0, out.slant);
  out.variance_m2 =
      noise_m * noise_m / options_.ranges_per_point + options_.point_sigma_m * options_.point_sigma_m;
  return out;
}

std::vector<Sight> Design::sights(const Eigen::Vector3d& point) const {
  std::vector<Sight> out;
  out.reserve(anchors_.size());
  for (const auto& anchor : anchors_) out.push_back(sight(point, anchor));
  return out;
}

double Design::square_m2(const ErrorModel& error_model) const {
  return error_model.covariance.topLeftCorner<3, 3>().trace() +
         options_.wall_excess_m * options_.wall_excess_m * error_model.shift.head<3>().squaredNorm();
}

double Design::value_of(const ErrorModel& error_model) const {
  if (options_.rule == Rule::a_optimal) return square_m2(error_model);
  const Eigen::Vector3d shift = options_.wall_excess_m * error_model.shift.head<3>();
  return std::log((error_model.covariance.topLeftCorner<3, 3>() + shift * shift.transpose()).determinant());
}

void Design::update(std::span<const Sight> point, double sign) {
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Sight& s = point[i];
    ErrorModel& b = error_models_[i];
    const Eigen::Vector4d ph = b.covariance * s.row;
    const double innovation = s.variance_m2 + sign * s.row.dot(ph);
    b.shift += sign * ph * (s.slant - s.row.dot(b.shift)) / innovation;
    b.covariance -= sign * ph * ph.transpose() / innovation;
  }
}

double Design::value() const {
  double out = 0;
  for (const auto& error_model : error_models_) out += value_of(error_model);
  return out;
}

double Design::value_with(std::span<const Sight> point) const {
  double out = 0;
  for (std::size_t i = 0; i < anchors_.size(); ++i) {
    const Sight& s = point[i];
    const ErrorModel& b = error_models_[i];
    const Eigen::Vector4d ph = b.covariance * s.row;
    const double innovation = s.variance_m2 + s.row.dot(ph);
    const Eigen::Vector4d shift = b.shift + ph * (s.slant - s.row.dot(b.shift)) / innovation;
    if (options_.rule == Rule::a_optimal) {  // the trace alone needs no matrix
      out += b.covariance.topLeftCorner<3, 3>().trace() - ph.head<3>().squaredNorm() / innovation +
             options_.wall_excess_m * options_.wall_excess_m * shift.head<3>().squaredNorm();
    } else {
      out += value_of({b.covariance - ph * ph.transpose() / innovation, shift});
    }
  }
  return out;
}

double Design::mean_square_m2() const {
  double out = 0;
  for (const auto& error_model : error_models_) out += square_m2(error_model);
  return out / static_cast<double>(error_models_.size());
}

std::vector<double> Design::sigmas_m() const {
  std::vector<double> out;
  for (const auto& error_model : error_models_) out.push_back(std::sqrt(square_m2(error_model)));
  return out;
}

}  // namespace anchord::planning
