#include "core/localize/joint_model.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <utility>

#include "core/base/median.hpp"
#include "core/localize/error_model_likelihood.hpp"
#include "core/localize/joint_lines.hpp"
#include "core/localize/residual.hpp"

namespace anchord {
namespace {

constexpr double k_hinge_m = 5.0;
constexpr double k_least_slow_m = 0.05;   // no radio in the air was seen with less of it
constexpr double k_believed_white = 0.9;  // the share is an estimate; too much of it claims too much

/// Time the rows cover; a pause counts for no more than 2 s. So rows that are all further apart are looks of
/// their own, and errors that outlast a pause (real radios show them) are not taken for new ones.
double duration_s(std::span<const double> stamps_s) {
  constexpr double k_pause_s = 2.0;
  const double* const t_s = stamps_s.data();
  double sum_s = 0;
  for (std::size_t i = 1; i < stamps_s.size(); ++i) sum_s += std::min(t_s[i] - t_s[i - 1], k_pause_s);
  return std::max(sum_s, 1.0);
}

/// How much of scale^2 is noise that the next range does not share. Differences of neighbours show it, each
/// antenna by itself; without enough neighbours within half a second nothing is known, and nothing claimed.
class Neighbours {
 public:
  explicit Neighbours(std::size_t most) : jumps_m_(std::make_unique_for_overwrite<double[]>(most)) {}
  void add(const JointRow& row, double residual_m) {
    const std::pair antenna{row.tag, row.antenna};
    if (!newest_ || newest_->first != antenna) newest_ = &*last_.try_emplace(antenna).first;
    follow(newest_->second, row.t_s, residual_m);
  }
  /// The rows of one antenna that weigh something.
  void add_all(std::span<const double> stamps_s, std::span<const double> residuals_m,
               std::span<const double> weights) {
    Before before;
    for (std::size_t i = 0; i < weights.size(); ++i)
      if (weights.data()[i] > 0) follow(before, stamps_s.data()[i], residuals_m.data()[i]);
  }
  double white_share(double scale2) {
    if (n_ < 50) return 0.0;
    const double jump_m = 1.4826 * upper_median({jumps_m_.get(), n_});
    return std::min(0.5 * jump_m * jump_m / scale2, 1.0);
  }

 private:
  struct Before {
    double t_s{-std::numeric_limits<double>::infinity()}, residual_m{};
  };
  void follow(Before& before, double t_s, double residual_m) {
    if (t_s - before.t_s <= 0.5) jumps_m_[n_++] = std::abs(residual_m - before.residual_m);
    before = {t_s, residual_m};
  }
  using Last = std::map<std::pair<NetworkId, std::uint8_t>, Before>;
  Last last_;
  Last::value_type* newest_{nullptr};  ///< most ranges are of the antenna of the one before
  std::unique_ptr<double[]> jumps_m_;
  std::size_t n_{0};
};

/// How much of what the error models claim may be claimed: 1 as long as the errors are what the model said.
/// Larger ones make the slope of the likelihood vary more than its curvature allows, and the covariance is
/// then that of a misspecified likelihood, H^-1 J H^-1 (Huber 1967; White 1982), by one number for the
/// anchor.
double believed_share(const JointLines& lines) {
  constexpr double step_m = 1e-3, allowed = 1.2;  // H and J are sums of some hundred terms: 20 % is chance
  double curvature = 0, variance = 0, claimed = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const RangeErrorModel* model = lines.rows()[i]->error_model;
    if (!model) continue;
    const double residual_m = lines.of(JointLines::residual)[i];
    const auto at = [&](double error_m) {
      return error_model_value(*model, error_m, lines.of(JointLines::variance)[i]);
    };
    const ErrorModelValue here = at(residual_m);
    claimed += here.information_per_m2;
    variance += here.score_per_m * here.score_per_m;
    curvature += (at(residual_m + step_m).score_per_m - at(residual_m - step_m).score_per_m) / (2 * step_m);
  }
  if (!(claimed > 0)) return 1.0;
  curvature = std::max(curvature, 1e-3 * claimed);
  return std::min(1.0, allowed * curvature * std::min(1.0, curvature / variance) / claimed);
}

/// What the block of one anchor is built from.
struct AnchorTask {
  const FlightRows& flight;
  const AnchorRows& rows;
  const JointState::Anchor& anchor;
  const SharedVector& shared;
  const FlightOptions& options;
  double scale_floor_m{};   ///< the scale of its residuals is no less
  double kept_scale_m{};    ///< above 0: taken for it, nothing is measured
  double common_scale_m{};  ///< unit of the weights of eq 7.11
  bool claims{};            ///< information as it is claimed in the end, not as the search needs it
};

/// Scatter of the ranges kept. Jumps to those that are off by metres, and the scale they blow up, are no
/// noise: taken for it they would make spoilt ranges count for more than clean ones.
double kept_variance_m2(std::vector<double>& kept_sizes_m, double scale_m, double min_scale_m) {
  const double kept_m = kept_sizes_m.empty() ? scale_m : 1.4826 * upper_median(kept_sizes_m);
  return std::clamp(kept_m * kept_m, min_scale_m * min_scale_m, scale_m * scale_m);
}

/// Sigmas where the loss bends.
double bend_of(const FlightOptions& options) {
  return default_bend(options.loss) * (options.loss == Loss::tukey ? options.mad_factor : 1.0);
}

/// What the robust loss makes of rows without an error model, beside what widens them.
std::vector<double> robust_weights(const AnchorTask& task, const AnchorBlock& block,
                                   const JointLines& lines) {
  const FlightOptions& options = task.options;
  const double scale2 = block.scale_m * block.scale_m;
  if (options.loss == Loss::tukey && options.weights != Weights::as_printed)
    return tukey_weights(lines, scale2, block.usual_position_variance_m2, bend_of(options));
  std::vector<double> out(lines.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double beyond_m2 = lines.of(JointLines::variance)[i] - block.usual_position_variance_m2;
    const double widening = (scale2 + std::max(beyond_m2, 0.0)) / scale2;
    const double residual_m = lines.of(JointLines::residual)[i];
    out[i] = robust_weight(residual_m / (block.scale_m * std::sqrt(widening)), options) / widening;
    if (options.weights == Weights::as_printed)
      out[i] *= std::sqrt(widening) * block.scale_m / task.common_scale_m;
  }
  return out;
}

/// Weights of all rows, and what they sum to in the block. A residual becomes what its row pulls with.
std::vector<double> weigh(const AnchorTask& task, JointLines& lines, AnchorBlock& block) {
  const double scale2 = block.scale_m * block.scale_m;
  const double believed = task.claims ? believed_share(lines) : 1.0;
  std::vector<double> weights = robust_weights(task, block, lines);
  double sum_square = 0;
  if (lines.without_models()) {
    const double* const residual_m = lines.of(JointLines::residual).data();
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const double counted = weights.data()[i];
      block.sum_weight += counted;
      sum_square += counted * residual_m[i] * residual_m[i];
    }
  }
  for (std::size_t i = 0; i < lines.size() && !lines.without_models(); ++i) {
    double& residual_m = lines.of(JointLines::residual)[i];
    double counted = weights[i], counted_m = residual_m;
    if (const RangeErrorModel* model = lines.rows()[i]->error_model) {
      // Where a model spoke, its likelihood takes the place of scale and loss; the pull is its exact slope.
      const ErrorModelValue value = error_model_value(*model, residual_m, lines.of(JointLines::variance)[i]);
      const double weight = (task.claims ? value.information_per_m2 : value.curvature_per_m2) * scale2;
      counted = value.p_los;
      counted_m -= model->los_bias_m;
      residual_m = weight > 0 ? value.score_per_m * scale2 / weight : 0.0;
      weights[i] = weight * believed;
    }
    block.sum_weight += counted;
    sum_square += counted * counted_m * counted_m;
  }
  if (block.sum_weight > 0) block.rms_m = std::sqrt(sum_square / block.sum_weight);
  return weights;
}

void build_anchor(const AnchorTask& task, AnchorBlock& block, JointNormal& normal) {
  const FlightOptions& options = task.options;
  JointLines lines(task.flight.track, task.rows.rows, task.shared, task.anchor);
  for (std::size_t why = 0; why < lines.refused().size(); ++why)
    if (lines.refused()[why] > 0)
      block.refused[std::string(to_string(static_cast<TrackRefusal>(why)))] += lines.refused()[why];
  block.n_in_track = lines.size();
  if (lines.size() == 0) return;
  block.last_t_s = std::max(block.last_t_s, lines.rows().back()->t_s);
  std::vector<double> centred_m, sorted;
  centred_m.assign(lines.of(JointLines::residual).begin(), lines.of(JointLines::residual).end());
  for (std::size_t i = 0; i < centred_m.size() && !lines.without_models(); ++i)
    if (const RangeErrorModel* model = lines.rows()[i]->error_model) centred_m[i] -= expected_error_m(*model);
  // The MAD holds the usual position error already; only what a row has beyond that makes it count less.
  sorted.assign(lines.of(JointLines::variance).begin(), lines.of(JointLines::variance).end());
  block.usual_position_variance_m2 = upper_median(sorted);
  block.scale_m = task.kept_scale_m;
  if (!(task.kept_scale_m > 0)) {
    std::ranges::transform(centred_m, sorted.begin(), [](double v) { return std::abs(v); });
    block.scale_m = std::max({1.4826 * upper_median(sorted), options.min_scale_m, task.scale_floor_m});
  }
  const std::vector<double> weights = weigh(task, lines, block);
  Neighbours neighbours(lines.size());
  if (lines.one_antenna()) {
    neighbours.add_all(lines.of(JointLines::stamp), centred_m, weights);
  } else {
    for (std::size_t i = 0; i < lines.size(); ++i)
      if (weights[i] > 0) neighbours.add(*lines.rows()[i], centred_m[i]);
  }
  for (std::size_t i = 0; i < weights.size(); ++i) {
    // No branch: the next takes the place of what weighs nothing.
    sorted.data()[block.n_used] = std::abs(centred_m.data()[i]);
    block.n_used += weights.data()[i] > 0 ? 1 : 0;
  }
  sorted.resize(block.n_used);
  block.n_rejected = lines.size() - block.n_used;
  if (block.n_rejected > 0) block.refused["outlier"] = block.n_rejected;
  const double alike =
      std::max(1.0, 2.0 * options.correlation_s * block.sum_weight / duration_s(lines.of(JointLines::stamp)));
  // The mean over a correlation time keeps what is shared and averages the rest.
  block.white_share = neighbours.white_share(block.scale_m * block.scale_m);
  const double slow_share =
      k_least_slow_m * k_least_slow_m / kept_variance_m2(sorted, block.scale_m, options.min_scale_m);
  block.kappa = 1.0 + (alike - 1.0) * std::clamp(slow_share, 1.0 - k_believed_white * block.white_share, 1.0);
  add_lines(lines, weights, 1.0 / (block.kappa * block.scale_m * block.scale_m), block, normal);
}

}  // namespace

double robust_weight(double residual_over_scale, const FlightOptions& options) {
  return loss_value(options.loss, bend_of(options), residual_over_scale).weight;
}

AnchorPriors priors_of(NetworkId id, const FlightOptions& options) {
  const auto known = options.priors.find(id);
  return known == options.priors.end() ? AnchorPriors{} : known->second;
}

double range_curve(double distance_m) { return std::log(std::max(distance_m, k_hinge_m) / k_hinge_m); }

Eigen::Vector3d antenna_of(const TagPoint& point, const JointRow& row, const SharedVector& shared) {
  const double up_m = shared[k_shared_lever] + (row.arm ? shared[k_shared_antennas + *row.arm] : 0.0);
  return point.position_m + up_m * point.body_up + shared[k_shared_forward] * point.body_forward +
         shared[k_shared_left] * point.body_left;
}

JointLine linearise(const TagTrack& track, const JointRow& row, const SharedVector& shared,
                    const JointState::Anchor& anchor) {
  JointLine line;
  const TagPoint point = track.at(row.t_s + shared[k_shared_lag], row.lever_arm_body_m);
  line.refused = point.refused;
  if (point.refused != TrackRefusal::none) return line;
  const Eigen::Vector3d antenna = antenna_of(point, row, shared);
  line.antenna_m = antenna;
  const Eigen::Vector3d difference = antenna - anchor.position_m;
  const double distance_m = std::max(difference.norm(), 1e-6);
  const Eigen::Vector3d u = difference / distance_m;
  const double curve = range_curve(distance_m);
  const double slope = distance_m > k_hinge_m ? 1.0 + shared[k_shared_curve] / distance_m : 1.0;
  line.residual_m =
      row.distance_m - (distance_m + shared[k_shared_bias] + anchor.delay_m + shared[k_shared_curve] * curve);
  line.by_anchor << -slope * u, 1.0;
  line.by_shared[k_shared_bias] = 1.0;
  line.by_shared[k_shared_curve] = curve;
  line.by_shared[k_shared_lag] = slope * u.dot(point.velocity_mps);
  line.by_shared[k_shared_lever] = slope * u.dot(point.body_up);
  if (row.arm) line.by_shared[k_shared_antennas + *row.arm] = line.by_shared[k_shared_lever];
  line.by_shared[k_shared_forward] = slope * u.dot(point.body_forward);
  line.by_shared[k_shared_left] = slope * u.dot(point.body_left);
  line.position_variance_m2 = std::max(u.dot(point.covariance_m2 * u), 0.0);
  return line;
}

JointNormal build_normal(const FlightRows& flight, const JointState& state, const FlightOptions& options,
                         double scale_floor_m, const JointNormal* scales_from, bool claims) {
  JointNormal normal;
  normal.anchors.resize(flight.anchors.size());
  // Sigma of a mitigated line-of-sight range, only to give eq 7.11's weights the unit of an inverse variance.
  const double common_scale_m = std::sqrt(k_variance_los_m2);
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    AnchorBlock& block = normal.anchors[i];
    const auto& anchor = state.anchors[i];
    if (!anchor.active) continue;
    const double kept_scale_m = scales_from ? scales_from->anchors[i].scale_m : 0.0;
    build_anchor({flight, flight.anchors[i], anchor, state.shared, options, scale_floor_m, kept_scale_m,
                  common_scale_m, claims},
                 block, normal);
    const double delay_information = 1.0 / (options.delay_prior_m * options.delay_prior_m);
    block.own(3, 3) += delay_information;
    block.gradient[3] -= delay_information * anchor.delay_m;
    const PriorNormal prior = prior_normal(priors_of(flight.anchors[i].id, options), options.outline_m,
                                           options.outline_sigma_m, anchor.position_m);
    block.own.topLeftCorner<3, 3>() += prior.information;
    block.gradient.head<3>() += prior.gradient;
    if (options.dims == Dims::two) {
      block.own.row(2).setZero();
      block.own.col(2).setZero();
      block.own(2, 2) = 1.0;
      block.shared.row(2).setZero();
      block.gradient[2] = 0;
    }
    // 1e-6 of the largest: a direction no range sees stays where it is instead of flying off.
    Eigen::Matrix4d damped = block.own;
    damped.topLeftCorner<3, 3>().diagonal().array() +=
        1e-6 * block.own.topLeftCorner<3, 3>().diagonal().maxCoeff() + 1e-12;
    block.own_inverse = damped.ldlt().solve(Eigen::Matrix4d::Identity());
  }
  normal.reduced = normal.shared;
  normal.reduced_gradient = normal.shared_gradient;
  for (const AnchorBlock& block : normal.anchors) {
    normal.reduced.noalias() -= block.shared.transpose() * block.own_inverse * block.shared;
    normal.reduced_gradient.noalias() -= block.shared.transpose() * block.own_inverse * block.gradient;
  }
  return normal;
}

std::vector<Observation> observations_of(const FlightRows& flight, const AnchorRows& anchor,
                                         const SharedVector& shared, std::size_t most, double sigma_m) {
  std::vector<const JointRow*> placed;
  placed.reserve(anchor.rows.size());
  for (const JointRow& row : anchor.rows)
    if (flight.track.interval_at(row.t_s + shared[k_shared_lag]).refused == TrackRefusal::none)
      placed.push_back(&row);
  const std::size_t n = std::min(placed.size(), most);
  std::vector<Observation> out;
  out.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    const JointRow& row = *placed[i * placed.size() / n];
    const TagPoint point = flight.track.at(row.t_s + shared[k_shared_lag], row.lever_arm_body_m);
    Observation& o = out.emplace_back();
    o.tag_m = antenna_of(point, row, shared);
    o.distance_m = row.distance_m - shared[k_shared_bias];
    o.distance_m -= shared[k_shared_curve] * range_curve(o.distance_m);
    o.sigma_m = sigma_m;
    if (row.error_model) {
      o.distance_m -= expected_error_m(*row.error_model);
      o.sigma_m = std::hypot(sigma_m, (1.0 - row.error_model->p_los) * row.error_model->nlos_tail_m);
    }
  }
  return out;
}

std::vector<LevelSample> levels_of(const FlightRows& flight, const AnchorRows& anchor,
                                   const SharedVector& shared, const FlightOptions& options) {
  std::vector<LevelSample> all;
  if (!options.level_sigma_db) return all;
  for (const JointRow& row : anchor.rows) {
    if (!row.rss_dbm) continue;
    const TagPoint point = flight.track.at(row.t_s + shared[k_shared_lag], row.lever_arm_body_m);
    if (point.refused != TrackRefusal::none || point.body_forward.head<2>().norm() < 0.1) continue;
    all.push_back(
        {point.position_m, std::atan2(point.body_forward.x(), point.body_forward.y()), *row.rss_dbm});
  }
  constexpr std::size_t most = 400;
  if (all.size() <= most) return all;
  std::vector<LevelSample> few;
  for (std::size_t i = 0; i < most; ++i) few.push_back(all[i * all.size() / most]);
  return few;
}

}  // namespace anchord
