#include "core/localize/live_anchor.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/base/median.hpp"
#include "core/localize/error_ellipse.hpp"
#include "core/localize/flight_options.hpp"
#include "core/localize/geometry.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/prior_conflict.hpp"
#include "core/localize/warm_solve.hpp"
#include "core/planning/gdop.hpp"

namespace anchord {
namespace {

constexpr double k_floor_sigma_m = 0.04;
constexpr double k_scale_m = 1e-5;  ///< what sigmas along the lines of sight do not feel
constexpr std::size_t k_most_solved = 600, k_most_searched = 80;  ///< rows of one solve, of a search
constexpr double k_coarse_m =
    1e-3;  ///< tells the ends of a search apart, which lie decimetres from each other
constexpr double k_weak_share = 0.2;  ///< of the median range: a 95 % bound wider than this places nothing

SolverOptions solver_options(const LiveOptions& live, double bias_m) {
  SolverOptions options;
  options.loss = Loss::cauchy;
  options.loss_sigmas = 2.0;
  options.estimate_bias = true;
  options.bias_prior_m = bias_m;
  options.bias_prior_sigma_m = live.bias_prior_sigma_m;
  options.max_iterations = 100;     // a track near a plane leaves a long curved valley to walk down
  options.step_tolerance_m = 1e-7;  // Newton squares what is left of a step: good to nanometres
  return options;
}

std::vector<Observation> every_nth(std::span<const Observation> rows, std::size_t most) {
  std::vector<Observation> few;
  few.reserve(most);
  const double step = static_cast<double>(rows.size()) / static_cast<double>(most);
  for (std::size_t i = 0; i < most; ++i)
    few.push_back(rows[static_cast<std::size_t>(static_cast<double>(i) * step)]);
  return few;
}

double rms(const std::vector<double>& residuals) {
  // The middle two thirds: what the typical range does, not what the worst one did.
  std::vector<double> size;
  size.reserve(residuals.size());
  for (const double r : residuals) size.push_back(r * r);
  const auto keep = static_cast<std::ptrdiff_t>(std::max<std::size_t>(size.size() * 2 / 3, 1));
  std::ranges::nth_element(size, size.begin() + keep - 1);
  double sum = 0;
  for (std::ptrdiff_t i = 0; i < keep; ++i) sum += size[static_cast<std::size_t>(i)];
  return std::sqrt(sum / static_cast<double>(keep));
}

double scale_of(const std::vector<double>& residuals) {
  std::vector<double> size;
  size.reserve(residuals.size());
  for (const double r : residuals) size.push_back(std::abs(r));
  return std::max(1.4826 * upper_median(size), 0.02);
}

/// The answer, and its mirror solution where that is another place.
struct Answers {
  AnchorFit best;
  std::optional<AnchorFit> mirror;
  double worse{
      0};  ///< of the mirror: tempered likelihood ratio, and what the flight's priors hold against it
};

Answers with_mirror(const AnchorFit& found, RangeBlock& block, const WarmStart& mirror_start,
                    const SolverOptions& settings, double inflate, const AnchorPriors* priors) {
  Answers out{found, std::nullopt, 0};
  const auto mirror = solve_block(block, mirror_start, settings, k_scale_m);
  if (!mirror || !((mirror.value().position_m - found.position_m).norm() > 0.4)) return out;
  out.mirror = mirror.value();
  out.worse = std::max(out.mirror->cost - out.best.cost, 0.0) / inflate;
  if (priors != nullptr)
    out.worse +=
        prior_cost(*priors, {}, 1, out.mirror->position_m) - prior_cost(*priors, {}, 1, out.best.position_m);
  if (out.worse < 0) {
    std::swap(out.best, *out.mirror);
    out.worse = -out.worse;
  }
  return out;
}

Hypothesis hypothesis_of(const AnchorFit& fit, double inflate) {
  Hypothesis h;
  h.position.m = fit.position_m;
  h.covariance_m2 =
      fit.covariance_m2 * inflate + Eigen::Matrix3d::Identity() * k_floor_sigma_m * k_floor_sigma_m;
  h.rms_residual_m = rms(fit.residuals_m);
  return h;
}

/// The radii of the best place; where they are too large the geometry is weak.
void assess_precision(const GeometryReport& geometry, Estimate& estimate) {
  const ErrorEllipse ellipse = error_ellipse(estimate.best->covariance_m2);
  estimate.h95_m = ellipse.h95_m;
  estimate.v95_m = ellipse.v95_m;
  const double limit_m = k_weak_share * geometry.median_range_m;
  const bool collinear = geometry.kind == GeometryKind::collinear;
  if (!collinear && std::max(ellipse.h95_m, ellipse.v95_m) <= limit_m) return;
  char text[160];
  std::snprintf(text, sizeof text,
                "weak geometry: 95 %% within %.2f m horizontally and %.2f m vertically at a median range of "
                "%.2f m",
                ellipse.h95_m, ellipse.v95_m, geometry.median_range_m);
  estimate.verdict = Verdict::weak_geometry;
  estimate.reason = collinear ? geometry.reason : text;
}

void fill_gdop(std::span<const Observation> rows, const Eigen::Vector3d& anchor_m, Estimate& estimate) {
  std::vector<Eigen::Vector3d> places;
  places.reserve(rows.size());
  for (const auto& row : rows) places.push_back(row.tag_m);
  estimate.gdop.reset();
  estimate.gdop_trace.reset();
  if (const auto gdop = planning::gdop(anchor_m, places)) {
    estimate.gdop = gdop.value().root;
    estimate.gdop_trace = gdop.value().trace;
  }
}

}  // namespace

bool LiveAnchor::add(const Observation& row, UtcTime time, const LiveOptions& options, bool held) {
  ++used_;
  estimate_.n_used = used_;
  if (!newest_ || time > *newest_) newest_ = time;
  if (!first_ || time < *first_) first_ = time;
  if (skipped_++ % stride_ == 0) rows_.push_back(row);
  if (rows_.size() > options.max_rows) thin(options.max_rows);
  recent_.push_back({row, time});
  if (recent_.size() > options.max_rows) recent_.pop_front();
  estimate_.time = *newest_;
  if (held) return false;
  if (solved_ && seconds_between(*solved_, *newest_) < options.update_interval_s) return false;
  return solve(options);
}

void LiveAnchor::thin(std::size_t max_rows) {
  std::vector<Observation> half;
  for (std::size_t i = 0; i < rows_.size(); i += 2) half.push_back(rows_[i]);
  rows_ = std::move(half);
  stride_ *= 2;
  rows_at_search_ = std::min(rows_at_search_, max_rows / 2);
}

std::optional<double> LiveAnchor::residual_m(const Observation& row, const LiveOptions& options) const {
  if (!position_m_) return std::nullopt;
  return row.distance_m - correction_m(row.distance_m, options) - (row.tag_m - *position_m_).norm();
}

bool LiveAnchor::solve(const LiveOptions& options) {
  if (!newest_ || used_ == used_at_solve_) return false;
  used_at_solve_ = used_;
  solved_ = newest_;
  if (joint_) {
    refine();
    return true;
  }
  std::vector<Observation> few;
  std::span<const Observation> rows = rows_;
  if (rows.size() > k_most_solved) rows = few = every_nth(rows, k_most_solved);
  RangeBlock block(rows);
  const auto fit = search(block, solver_options(options, options.bias_m));
  describe(block, fit, options);
  return true;
}

Result<AnchorFit> LiveAnchor::search(RangeBlock& block, const SolverOptions& settings) {
  Result<AnchorFit> best = make_error(Errc::too_few_observations, "");
  if (rows_.size() < 5) return best;
  if (position_m_) best = solve_block(block, {*position_m_, bias_m_}, settings, k_scale_m);
  // While the geometry still grows the warm start may sit on the wrong side: look afresh at every doubling.
  if (!position_m_ || rows_.size() >= 2 * rows_at_search_) {
    rows_at_search_ = rows_.size();
    mirror_.reset();
    const std::span<const Observation> rows = rows_;
    const auto few = rows.size() > k_most_searched ? every_nth(rows, k_most_searched) : rows_;
    RangeBlock of_few(few);
    if (const auto start = best_of_starts(of_few, start_candidates(few), settings, k_scale_m, k_coarse_m)) {
      auto fit = solve_block(block, {start.value().position_m, start.value().bias_m}, settings, k_scale_m);
      if (!best || (fit && fit.value().cost < best.value().cost)) best = std::move(fit);
    }
  }
  if (best) {
    position_m_ = best.value().position_m;
    bias_m_ = best.value().bias_m;
  }
  return best;
}

/// Verdict and reason where the rows are too few or the track pins nothing down; false: nothing is to be
/// solved.
bool LiveAnchor::can_be_solved(const GeometryReport& geometry) {
  estimate_.mirror.reset();
  estimate_.best.reset();
  estimate_.reason = geometry.reason;
  estimate_.verdict = Verdict::too_few;
  if (geometry.kind == GeometryKind::too_few || rows_.size() < 5) {
    if (geometry.kind != GeometryKind::too_few)
      estimate_.reason = "too few: " + std::to_string(rows_.size()) + " ranges, need 5";
    return false;
  }
  // A search that settles nowhere on a track that pins nothing down is the track's fault, not the ranges'.
  const bool weak = geometry.kind != GeometryKind::good;
  estimate_.verdict = weak ? Verdict::weak_geometry : Verdict::diverged;
  if (!weak) estimate_.reason = "no position explains these ranges together";
  return position_m_.has_value();
}

void LiveAnchor::describe(RangeBlock& block, const Result<AnchorFit>& fit, const LiveOptions& options) {
  const GeometryReport geometry = assess_geometry(rows_);
  if (!can_be_solved(geometry)) return;
  const SolverOptions settings = solver_options(options, options.bias_m);
  const auto rows = block.observations();
  if (!fit) {
    if (fit.error().code == Errc::weak_geometry) estimate_.verdict = Verdict::weak_geometry;
    if (estimate_.reason.empty()) estimate_.reason = fit.error().message;
    return;
  }
  // The same tempering as the batch solve: two correlation times are one independent look.
  const double scale_m = scale_of(fit.value().residuals_m);
  const double duration_s = std::max(seconds_between(*first_, *newest_), 1.0);
  const double looks = std::max(duration_s / (2.0 * k_error_correlation_s), 1.0);
  const double inflate = std::max(static_cast<double>(rows.size()) / looks, 1.0) *
                         std::max(scale_m * scale_m / (options.range_sigma_m * options.range_sigma_m), 0.1);
  const auto told = options.priors.find(estimate_.anchor);
  const WarmStart reflected{geometry.shape.mirrored(fit.value().position_m), fit.value().bias_m};
  const Answers answers = with_mirror(fit.value(), block, mirror_.value_or(reflected), settings, inflate,
                                      told == options.priors.end() ? nullptr : &told->second);
  mirror_.reset();
  if (answers.mirror) mirror_ = {answers.mirror->position_m, answers.mirror->bias_m};
  position_m_ = answers.best.position_m;
  bias_m_ = answers.best.bias_m;
  estimate_.bias_m = answers.best.bias_m;
  estimate_.bias_sigma_m = answers.best.bias_sigma_m;
  estimate_.best = hypothesis_of(answers.best, inflate);
  estimate_.verdict = Verdict::ok;
  estimate_.reason.clear();
  if (answers.mirror) {
    const double odds = std::exp(-std::min(answers.worse, 700.0));
    if (odds > 0.01) {
      estimate_.mirror = hypothesis_of(*answers.mirror, inflate);
      estimate_.mirror->probability = odds / (1.0 + odds);
      estimate_.best->probability = 1.0 / (1.0 + odds);
      estimate_.verdict = Verdict::ambiguous;
      estimate_.reason = geometry.reason.empty() ? "mirror: another solution fits as well" : geometry.reason;
    }
  }
  assess_precision(geometry, estimate_);
  if (told != options.priors.end()) name_prior_conflict(told->second, Dims::three, estimate_);
  fill_gdop(rows, answers.best.position_m, estimate_);
}

Estimate LiveAnchor::estimate(const std::optional<EnuFrame>& frame) const {
  Estimate answer = estimate_;
  if (frame) {
    if (answer.best) answer.best->wgs84 = frame->wgs84_from_enu(answer.best->position);
    if (answer.mirror) answer.mirror->wgs84 = frame->wgs84_from_enu(answer.mirror->position);
  }
  return answer;
}

}  // namespace anchord
