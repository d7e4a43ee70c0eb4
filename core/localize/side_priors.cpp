#include "core/localize/side_priors.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/localize/turn.hpp"
#include "core/planning/bounds.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_least_levels = 30;
constexpr double k_outline_believed = 4.0;  // sigmas; odds of 3000 to 1
constexpr double k_clue_believed = 3.0;     // sigmas; by chance one in 370 is further off

double wrapped(double angle_rad) { return std::remainder(angle_rad, 2.0 * std::numbers::pi); }

/// A bearing or a height comes from the peak of a level, and a wall or the edge of a roof makes peaks of its
/// own, metres off. Beyond some sigmas the cost grows by the logarithm alone: it pulls the less the more the
/// ranges contradict it, and still decides between two places that the ranges leave open. Cost and gradient
/// are those of the half square of the row that is returned.
PriorRow doubted(const PriorRow& row) {
  const double sigmas = std::abs(row.missing);
  if (sigmas <= k_clue_believed) return row;
  constexpr double squared = k_clue_believed * k_clue_believed;
  const double size = std::sqrt(squared + 2.0 * squared * std::log(sigmas / k_clue_believed));
  return {row.slope * (squared / sigmas / size), std::copysign(size, row.missing)};
}

double bearing_of(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return std::atan2(to.x() - from.x(), to.y() - from.y());
}

/// Metres outside, and the unit vector that leads further out; 0 within.
double outside_m(std::span<const Eigen::Vector2d> outline, const Eigen::Vector2d& at, Eigen::Vector2d* away) {
  if (outline.size() < 3) return 0;
  const planning::Polygon polygon(outline.begin(), outline.end());
  if (planning::contains(polygon, at)) return 0;
  double nearest_m = 1e300;
  Eigen::Vector2d nearest = at;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i], edge = polygon[(i + 1) % polygon.size()] - a;
    const double share = std::clamp((at - a).dot(edge) / std::max(edge.squaredNorm(), 1e-12), 0.0, 1.0);
    const double distance_m = (at - a - share * edge).norm();
    if (distance_m >= nearest_m) continue;
    nearest_m = distance_m;
    nearest = a + share * edge;
  }
  if (away) *away = nearest_m > 1e-9 ? Eigen::Vector2d((at - nearest) / nearest_m) : Eigen::Vector2d(0, 0);
  return nearest_m;
}

}  // namespace

double outside_outline_m(std::span<const Eigen::Vector2d> outline_m, const Eigen::Vector3d& place_m) {
  return outside_m(outline_m, place_m.head<2>(), nullptr);
}

std::array<PriorRow, 3> prior_rows(const AnchorPriors& priors, std::span<const Eigen::Vector2d> outline_m,
                                   double outline_sigma_m, const Eigen::Vector3d& place_m) {
  std::array<PriorRow, 3> rows;
  if (const auto& b = priors.bearing) {
    const Eigen::Vector2d way = (place_m - b->tag_m).head<2>();
    const double far2 = std::max(way.squaredNorm(), 1.0);  // right above there is no bearing to speak of
    rows[0] = doubted({Eigen::Vector3d(way.y(), -way.x(), 0) / (far2 * b->sigma_rad),
                       wrapped(b->bearing_rad - bearing_of(b->tag_m, place_m)) / b->sigma_rad});
  }
  if (const auto& h = priors.height)
    rows[1] = doubted({Eigen::Vector3d::UnitZ() / h->sigma_m, (h->up_m - place_m.z()) / h->sigma_m});
  Eigen::Vector2d away(0, 0);
  const double outside = outside_m(outline_m, place_m.head<2>(), &away);
  const double sigmas = outside / outline_sigma_m;
  if (outside > 0) rows[2] = {Eigen::Vector3d(away.x(), away.y(), 0) / outline_sigma_m, -sigmas};
  // Not every anchor hangs on the building: far outside, the outline is no longer believed to speak of this
  // one, pulls it nowhere, and costs no more than the odds that a drawing is wrong.
  if (sigmas > k_outline_believed) rows[2] = {Eigen::Vector3d::Zero(), -k_outline_believed};
  return rows;
}

double prior_cost(const AnchorPriors& priors, std::span<const Eigen::Vector2d> outline_m,
                  double outline_sigma_m, const Eigen::Vector3d& place_m) {
  double squares = 0;
  for (const PriorRow& row : prior_rows(priors, outline_m, outline_sigma_m, place_m))
    squares += row.missing * row.missing;
  return 0.5 * squares;
}

PriorNormal prior_normal(const AnchorPriors& priors, std::span<const Eigen::Vector2d> outline_m,
                         double outline_sigma_m, const Eigen::Vector3d& place_m) {
  PriorNormal normal;
  for (const PriorRow& row : prior_rows(priors, outline_m, outline_sigma_m, place_m)) {
    normal.information += row.slope * row.slope.transpose();
    normal.gradient += row.slope * row.missing;
  }
  return normal;
}

double level_cost(std::span<const LevelSample> samples, const Eigen::Vector3d& place_m, double sigma_db) {
  if (samples.size() < k_least_levels) return 0;
  Eigen::Vector2d together(0, 0);
  for (const auto& s : samples) together += Eigen::Vector2d(std::sin(s.heading_rad), std::cos(s.heading_rad));
  // Headings within about a quarter turn leave the mean vector longer than 0.9: the lobes were not swept.
  if (together.norm() > 0.9 * static_cast<double>(samples.size())) return 0;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  double squares = 0;
  for (const auto& s : samples) {
    const double far_m = std::max((place_m - s.tag_m).norm(), 0.5);
    const double level_db = s.rss_dbm + 20.0 * std::log10(far_m);
    const Eigen::Vector2d row(1.0, turn_profile(s.heading_rad - bearing_of(s.tag_m, place_m)));
    normal += row * row.transpose();
    right += row * level_db;
    squares += level_db * level_db;
  }
  Eigen::Vector2d fit = normal.ldlt().solve(right);
  if (fit[1] < 0) fit = {right[0] / normal(0, 0), 0};  // lobes turned inside out are no lobes
  return 0.5 * std::max(squares - 2.0 * fit.dot(right) + fit.dot(normal * fit), 0.0) / (sigma_db * sigma_db);
}

}  // namespace anchord
