#include "core/localize/flight_verdict.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <span>

#include "core/localize/error_ellipse.hpp"
#include "core/localize/gates.hpp"
#include "core/localize/geometry.hpp"
#include "core/localize/held_height.hpp"
#include "core/localize/prior_conflict.hpp"
#include "core/localize/residual.hpp"
#include "core/localize/solver.hpp"
#include "core/localize/warm_solve.hpp"
#include "core/planning/gdop.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_min_used = 10;  // below, no scale can be told from the residuals
constexpr double k_sigma_ratio = 0.08;  // sH/D above: undetermined (seen 0.083 and up; 0.078 passes)
constexpr double k_sigma_ratio_marginal = 0.05;
constexpr double k_mirror_distance_m = 0.4;
constexpr double k_decided_odds = 1.0 / 99.0;  // beyond 99 % one place is the answer
constexpr double k_mirror_cost = 4.6;          // tempered: ln 99

/// What the priors hold against a place; differences are log odds.
class Priors {
 public:
  Priors(const FlightRows& flight, const JointFit& fit, std::size_t index, const FlightOptions& options)
      : options_(options),
        priors_(priors_of(flight.anchors[index].id, options)),
        levels_(levels_of(flight, flight.anchors[index], fit.state.shared, options)) {
    // As for ranges: so many levels in a correlation time say the same thing.
    const AnchorBlock& block = fit.normal.anchors[index];
    if (!levels_.empty())
      alike_ = std::max(
          1.0, block.kappa * static_cast<double>(levels_.size()) / static_cast<double>(block.n_in_track));
  }
  double cost(const Eigen::Vector3d& place_m) const {
    const double told = prior_cost(priors_, options_.outline_m, options_.outline_sigma_m, place_m);
    return told + (levels_.empty() ? 0.0 : level_cost(levels_, place_m, *options_.level_sigma_db) / alike_);
  }

 private:
  const FlightOptions& options_;
  AnchorPriors priors_;
  std::vector<LevelSample> levels_;
  double alike_{1};
};

struct Mirror {
  AnchorMinimum fit;
  double worse{};  ///< tempered cost above the solution's
  double horizontal_m{};
};

std::string text(const char* format, double a, double b, double c) {
  char buffer[240];
  std::snprintf(buffer, sizeof buffer, format, a, b, c);
  return buffer;
}

/// Other places that fit about as well, best first.
std::vector<Mirror> mirrors_of(const FlightRows& flight, const JointFit& fit, std::size_t index,
                               const TrackShape& shape, const Priors& priors, const FlightOptions& options) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const Eigen::Vector3d solution = fit.state.anchors[index].position_m;
  const auto rows = observations_of(flight, flight.anchors[index], fit.state.shared, 400, block.scale_m);
  SolverOptions settings;
  settings.dims = options.dims;
  settings.estimate_bias = true;
  settings.step_tolerance_m = 1e-6;
  // Bias prior in the scale of the thinned, untempered cost below.
  const double unit =
      static_cast<double>(block.n_in_track) / (static_cast<double>(rows.size()) * block.kappa);
  settings.bias_prior_sigma_m = options.delay_prior_m * std::sqrt(unit);
  RangeBlock block_of_rows(rows);
  // Where a start came near to where one before it did, it would end there too.
  std::vector<Eigen::Vector3d> rough_m;
  const auto polish = [&](const Eigen::Vector3d& start) -> std::optional<AnchorMinimum> {
    settings.loss = Loss::cauchy;
    settings.loss_sigmas = 2.0;
    const auto rough = descend_to_minimum(block_of_rows, start, settings);
    if (!rough) return std::nullopt;
    const auto known = [&](const Eigen::Vector3d& p) { return (rough.value().position_m - p).norm() < 1e-4; };
    if (std::ranges::any_of(rough_m, known)) return std::nullopt;
    rough_m.push_back(rough.value().position_m);
    settings.loss = options.loss;
    settings.loss_sigmas =
        default_bend(options.loss) * (options.loss == Loss::tukey ? options.mad_factor : 1.0);
    const auto fine = descend_to_minimum(block_of_rows, rough.value().position_m, settings);
    if (!fine) return std::nullopt;
    return fine.value();
  };
  const auto here = polish(solution);
  std::vector<Mirror> mirrors;
  if (!here) return mirrors;
  std::vector<Eigen::Vector3d> starts{shape.mirrored(solution)};
  const Eigen::Vector3d axis = shape.axes.col(2);
  for (int k = 1; k < 8; ++k) {
    const Eigen::AngleAxisd turn(k * std::numbers::pi / 4.0, axis);
    starts.push_back(shape.centroid_m + turn * (solution - shape.centroid_m));
  }
  for (auto& start : starts) {
    // A held height has no mirror; only what lies beside it can fit as well.
    if (options.dims == Dims::two) start.z() = solution.z();
    auto there = polish(start);
    if (!there) continue;
    const double worse =
        (there->cost - here->cost) * unit + priors.cost(there->position_m) - priors.cost(solution);
    const auto close = [&](const Eigen::Vector3d& p) {
      return (there->position_m - p).norm() < k_mirror_distance_m;
    };
    if (worse > k_mirror_cost || close(solution) || close(here->position_m)) continue;
    if (std::ranges::any_of(mirrors, [&](const Mirror& t) { return close(t.fit.position_m); })) continue;
    const double horizontal_m = (there->position_m - here->position_m).head<2>().norm();
    mirrors.push_back({*there, worse, horizontal_m});
  }
  std::ranges::sort(mirrors, {}, &Mirror::worse);
  return mirrors;
}

Hypothesis hypothesis(const FlightRows& flight, const Eigen::Vector3d& position,
                      const Eigen::Matrix3d& covariance, double rms_m) {
  Hypothesis h;
  h.position.m = position;
  if (flight.frame) h.wgs84 = flight.frame->wgs84_from_enu(h.position);
  h.covariance_m2 = covariance;
  h.rms_residual_m = rms_m;
  return h;
}

void fill_gdop(Estimate& estimate, const std::vector<Observation>& rows, const Eigen::Vector3d& anchor,
               Dims dims) {
  std::vector<Eigen::Vector3d> places;
  std::vector<Eigen::Vector2d> flat;
  for (const auto& o : rows) {
    places.push_back(o.tag_m);
    flat.emplace_back(o.tag_m.head<2>());
  }
  const auto gdop = dims == Dims::two ? planning::gdop(Eigen::Vector2d(anchor.head<2>()), flat)
                                      : planning::gdop(anchor, places);
  if (!gdop) return;
  estimate.gdop = gdop.value().root;
  estimate.gdop_trace = gdop.value().trace;
}

/// Covariance of an anchor's position were the shared bias known.
Eigen::Matrix3d known_bias_covariance(const JointFit& fit, std::size_t index) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const Eigen::Vector4d with_bias =
      -block.own_inverse * (block.shared * fit.shared_covariance.col(k_shared_bias));
  const Eigen::Matrix4d known =
      fit.anchor_covariance[index] - with_bias * with_bias.transpose() /
                                         std::max(fit.shared_covariance(k_shared_bias, k_shared_bias), 1e-12);
  return known.topLeftCorner<3, 3>();
}

double horizontal_sigma_of(const Eigen::Matrix3d& covariance, const FlightOptions& options) {
  const Eigen::Matrix3d with_floor =
      covariance + Eigen::Matrix3d::Identity() * options.floor_sigma_m * options.floor_sigma_m;
  return error_ellipse(with_floor).major_m / std::sqrt(5.991464547107979);
}

/// Mirrors, probabilities and the part of the position that stands.
void assess_mirrors(const FlightRows& flight, AnchorSolution& solution, const std::vector<Mirror>& mirrors,
                    const GeometryReport& geometry, const Priors& priors) {
  Estimate& estimate = solution.estimate;
  const Mirror* mirror = mirrors.empty() ? nullptr : &mirrors.front();
  if (!mirror && geometry.kind != GeometryKind::coplanar) return;
  if (mirror) {
    estimate.mirror = hypothesis(flight, mirror->fit.position_m, estimate.best->covariance_m2,
                                 estimate.best->rms_residual_m);
    const double odds = std::exp(-std::clamp(mirror->worse, -50.0, 50.0));
    estimate.mirror->probability = odds / (1.0 + odds);
    estimate.best->probability = 1.0 / (1.0 + odds);
  }
  estimate.verdict = Verdict::ambiguous;
  const bool sideways = mirror && std::ranges::any_of(mirrors, [](const Mirror& t) {
                          return t.horizontal_m > k_mirror_distance_m;
                        });
  solution.determined = sideways ? Determined::none : Determined::horizontal;
  if (!mirror) {
    // No second minimum of its own, but a plane cannot tell the sides: what its reflection says is as good.
    const Eigen::Vector3d reflected = geometry.shape.mirrored(estimate.best->position.m);
    estimate.reason = geometry.reason +
                      "; it is not determined on which side of it the anchor is, and its height is uncertain";
    const double apart_m = (reflected - estimate.best->position.m).norm();
    const double odds =
        std::exp(-std::clamp(priors.cost(reflected) - priors.cost(estimate.best->position.m), -50.0, 50.0));
    if (apart_m > k_mirror_distance_m && odds < k_decided_odds) {
      estimate.verdict = Verdict::ok;
      estimate.reason.clear();
      solution.determined = Determined::position;
      estimate.best->probability = 1.0 / (1.0 + odds);
      return;
    }
    if (apart_m < 0.1) return;
    estimate.mirror =
        hypothesis(flight, reflected, estimate.best->covariance_m2, estimate.best->rms_residual_m);
    estimate.best->probability = 1.0 / (1.0 + odds);
    estimate.mirror->probability = odds / (1.0 + odds);
    estimate.v95_m += std::abs(reflected.z() - estimate.best->position.m.z());
    return;
  }
  const double apart_m = (mirror->fit.position_m - estimate.best->position.m).norm();
  estimate.reason =
      text("mirror: a solution %.2f m away fits as well (misfit %+.2f, %.2f m apart horizontally)", apart_m,
           std::round(100 * mirror->worse) / 100 + 0.0, mirror->horizontal_m);  // no "-0.00"
  if (!geometry.reason.empty()) estimate.reason += "; " + geometry.reason;
  // Until someone says which, the claimed height must hold both.
  estimate.v95_m = std::max(
      estimate.v95_m, std::abs(mirror->fit.position_m.z() - estimate.best->position.m.z()) + estimate.v95_m);
}

/// Why the track has no place for ranges of an anchor that takes no part.
void count_unplaced(const FlightRows& flight, const AnchorRows& rows, double lag_s, Estimate& estimate) {
  for (const JointRow& row : rows.rows) {
    const auto why = flight.track.at(row.t_s + lag_s, row.lever_arm_body_m).refused;
    if (why != TrackRefusal::none) ++estimate.refused[std::string(to_string(why))];
  }
}

/// A bias nobody knows makes the region wide and is told as what it is (gates bias and precision); geometry
/// is to blame only for what would remain if it were known, `geometric_sigma_m`.
void assess_geometric_sigma(double geometric_sigma_m, const GeometryReport& geometry,
                            AnchorSolution& solution) {
  Estimate& estimate = solution.estimate;
  const double geometric_ratio = geometric_sigma_m / geometry.median_range_m;
  if (geometry.kind == GeometryKind::collinear || geometric_ratio > k_sigma_ratio) {
    estimate.verdict = Verdict::weak_geometry;
    solution.determined = Determined::none;
    estimate.reason =
        geometry.kind == GeometryKind::collinear
            ? geometry.reason
            : text("weak geometry: horizontal sigma %.2f m at a median range of %.2f m (ratio %.3f)",
                   geometric_sigma_m, geometry.median_range_m, geometric_ratio);
  } else if (estimate.verdict == Verdict::ok && (geometry.line_ratio < GeometryLimits{}.line_marginal ||
                                                 solution.geometry.sigma_ratio > k_sigma_ratio_marginal)) {
    estimate.reason = text(
        "near the limit of geometry: line ratio %.3f, horizontal sigma over range %.3f (limits 0.07 and "
        "%.2f)",
        geometry.line_ratio, solution.geometry.sigma_ratio, k_sigma_ratio);
  }
}

AnchorSolution verdict_of(const FlightRows& flight, const JointFit& fit, std::size_t index,
                          const FlightOptions& options) {
  const AnchorRows& rows = flight.anchors[index];
  const AnchorBlock& block = fit.normal.anchors[index];
  const JointState::Anchor& anchor = fit.state.anchors[index];
  AnchorSolution solution;
  Estimate& estimate = solution.estimate;
  estimate.anchor = rows.id;
  solution.name = rows.name;
  estimate.refused = rows.refused;
  for (const auto& [why, count] : block.refused) estimate.refused[why] += count;
  estimate.n_used = block.n_used;
  estimate.time = UtcTime{flight.epoch.ns + std::llround(block.last_t_s * 1e9)};
  const auto observations = observations_of(flight, rows, fit.state.shared, 2000, 1.0);
  const GeometryReport geometry = assess_geometry(observations, options.dims);
  solution.geometry = {geometry.shape.sd_m, geometry.median_range_m, geometry.line_ratio,
                       geometry.plane_ratio, 0};
  if (!anchor.active || geometry.kind == GeometryKind::too_few || block.n_used < k_min_used) {
    estimate.verdict = Verdict::too_few;
    estimate.reason = !geometry.reason.empty() ? geometry.reason
                                               : "too few: " + std::to_string(block.n_used) +
                                                     " usable ranges, need " + std::to_string(k_min_used);
    if (!anchor.active) count_unplaced(flight, rows, fit.state.shared[k_shared_lag], estimate);
    return solution;
  }
  const Eigen::Matrix4d& joint = fit.anchor_covariance[index];
  solution.fit_covariance_m2 = joint.topLeftCorner<3, 3>();
  if (options.dims == Dims::two) {
    solution.fit_covariance_m2.row(2).setZero();
    solution.fit_covariance_m2.col(2).setZero();
    solution.fit_covariance_m2 += held_height_m2(flight, fit, index, options);
  }
  solution.delay_m = anchor.delay_m;
  solution.delay_sigma_m = std::sqrt(joint(3, 3));
  solution.residual_scale_m = block.scale_m;
  const Eigen::Matrix3d covariance = solution.fit_covariance_m2 + Eigen::Matrix3d::Identity() *
                                                                      options.floor_sigma_m *
                                                                      options.floor_sigma_m;
  if (!anchor.position_m.allFinite() || !covariance.allFinite() || block.scale_m > 2.0 ||
      (anchor.position_m - geometry.shape.centroid_m).norm() > 3.0 * options.max_range_m) {
    estimate.verdict = Verdict::diverged;
    estimate.reason =
        text("no consistent position: typical residual %.2f m at a median range of %.2f m over %.0f ranges",
             block.scale_m, geometry.median_range_m, static_cast<double>(block.n_in_track));
    return solution;
  }
  estimate.best = hypothesis(flight, anchor.position_m, covariance, block.rms_m);
  const ErrorEllipse ellipse = error_ellipse(covariance);
  estimate.h95_m = ellipse.h95_m;
  estimate.v95_m = ellipse.v95_m;
  fill_gdop(estimate, observations, anchor.position_m, options.dims);
  estimate.verdict = Verdict::ok;
  solution.determined = options.dims == Dims::two ? Determined::horizontal : Determined::position;
  const double horizontal_sigma_m = ellipse.major_m / std::sqrt(5.991464547107979);
  solution.geometry.sigma_ratio = horizontal_sigma_m / geometry.median_range_m;
  const Priors priors(flight, fit, index, options);
  assess_mirrors(flight, solution, mirrors_of(flight, fit, index, geometry.shape, priors, options), geometry,
                 priors);
  assess_geometric_sigma(horizontal_sigma_of(known_bias_covariance(fit, index), options), geometry, solution);
  name_prior_conflict(priors_of(flight.anchors[index].id, options), options.dims, estimate);
  return solution;
}

/// What only somebody at the site can set right stands in the reason too, not in its gate alone.
void name_failed(std::span<const char* const> names, Estimate& estimate) {
  for (const Gate& gate : estimate.gates) {
    if (gate.passed || std::ranges::find(names, gate.name) == names.end()) continue;
    estimate.reason += (estimate.reason.empty() ? "" : "; ") + gate.why;
  }
}

}  // namespace

AnchorSolution assess_anchor(const FlightRows& flight, const JointFit& fit, std::size_t index,
                             const FlightOptions& options) {
  AnchorSolution solution = verdict_of(flight, fit, index, options);
  if (fit.state.anchors[index].active) solution.residuals = residuals_of(flight, fit, index, options);
  solution.estimate.gates = gates_of(flight, fit, index, solution, options);
  constexpr std::array k_for_people{"second_place", "own_delay"};
  name_failed(k_for_people, solution.estimate);
  return solution;
}

}  // namespace anchord
