#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/localize/joint_model.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/solver.hpp"

namespace anchord {
namespace {

constexpr int k_max_rounds = 60;
constexpr int k_scale_rounds = 20;
constexpr std::size_t k_min_rows = 5;  // one more than x, y, z and a shared bias ask for

double clipped(double value, double limit) { return std::clamp(value, -limit, limit); }

bool has_beliefs(const FlightRows& flight) {
  return std::ranges::any_of(flight.anchors, [](const AnchorRows& anchor) {
    return std::ranges::any_of(anchor.rows, [](const JointRow& row) { return row.belief.has_value(); });
  });
}

/// The start somebody gave: a place, or where the bearing of the turn and the height search meet at the range
/// measured nearest to the turn.
std::optional<Eigen::Vector3d> told_start(NetworkId id, const std::vector<Observation>& rows,
                                          const AnchorClues& clues, const FlightOptions& options) {
  if (const auto told = options.starts.find(id); told != options.starts.end()) return told->second;
  if (!options.start_at_clues || !clues.bearing || !clues.height) return std::nullopt;
  const Eigen::Vector3d& turn_m = clues.bearing->tag_m;
  const auto away = [&](const Observation& o) { return (o.tag_m - turn_m).norm(); };
  const double range_m = std::ranges::min_element(rows, {}, away)->distance_m;
  const double up_m = clues.height->up_m - turn_m.z();
  const double across_m = std::sqrt(std::max(range_m * range_m - up_m * up_m, 0.25));
  return Eigen::Vector3d(turn_m.x() + across_m * std::sin(clues.bearing->bearing_rad),
                         turn_m.y() + across_m * std::cos(clues.bearing->bearing_rad), clues.height->up_m);
}

/// Best of many starts for one anchor; Cauchy of 0.3 m and a bias of its own, so that a kit's bias does not
/// push the anchor into the wrong basin before the joint solve can see it.
std::optional<Eigen::Vector3d> start_of(const FlightRows& flight, const AnchorRows& anchor,
                                        const SharedPrior& prior, const FlightOptions& options,
                                        std::optional<double> height_m) {
  auto rows = observations_of(flight, anchor, prior.mean, 200, 0.3);
  if (rows.size() < k_min_rows) return std::nullopt;
  SolverOptions settings;
  settings.dims = options.dims;
  settings.loss = Loss::cauchy;
  settings.loss_sigmas = 1.0;
  settings.estimate_bias = !options.fixed_bias_m;
  settings.bias_prior_sigma_m = 0.5;
  const AnchorClues clues = clues_of(anchor.id, options);
  const auto levels = levels_of(flight, anchor, prior.mean, options);
  const double span_s = std::max(anchor.rows.back().t_s - anchor.rows.front().t_s, 1.0);
  const double alike =
      std::max(2.0 * options.correlation_s * static_cast<double>(levels.size()) / span_s, 1.0);
  std::optional<AnchorFit> best;
  auto starts = start_candidates(rows, options.dims);
  if (const auto told = told_start(anchor.id, rows, clues, options)) starts = {*told};
  for (Eigen::Vector3d start : starts) {
    if (height_m) start.z() = *height_m;
    auto fit = solve_anchor_gauss_newton(rows, start, settings);
    if (!fit) continue;
    // The twin fits as well: a clue, told in the same unit, is what decides where to begin.
    const Eigen::Vector3d& place_m = fit.value().position_m;
    fit.value().cost += clue_cost(clues, options.outline_m, options.outline_sigma_m, place_m);
    if (!levels.empty()) fit.value().cost += level_cost(levels, place_m, *options.level_sigma_db) / alike;
    if (!best || fit.value().cost < best->cost) best = std::move(fit.value());
  }
  if (best) return best->position_m;
  // No start converged (a line, for example): the joint solve is heavily damped there and may begin anywhere
  // near.
  const auto linear = start_candidates(rows, options.dims);
  Eigen::Vector3d start = linear.front();
  if (height_m) start.z() = *height_m;
  return start;
}

}  // namespace

JointState joint_start(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options) {
  JointState state;
  state.shared = prior.mean;
  std::optional<double> height_m;
  if (options.dims == Dims::two) {
    double sum_m = 0;
    for (const auto& pose : flight.track.poses()) sum_m += pose.position_m.z();
    height_m = options.anchor_height_m.value_or(sum_m / static_cast<double>(flight.track.poses().size()));
  }
  for (const AnchorRows& rows : flight.anchors) {
    JointState::Anchor anchor;
    const auto start = start_of(flight, rows, prior, options, height_m);
    anchor.active = start.has_value();
    if (start) anchor.position_m = *start;
    state.anchors.push_back(anchor);
  }
  return state;
}

Result<JointFit> solve_joint(const FlightRows& flight, const JointState& start, const SharedPrior& prior,
                             const FlightOptions& options) {
  JointFit fit;
  fit.state = start;
  // The Gauss-Newton rounds bring every method near; Ceres then does the rest where it is asked for.
  // Ranges between anchors are solved here whatever the method: their network is small and dense. So are
  // ranges a model spoke about, whose likelihood is no sum of squares.
  const bool by_ceres =
      options.method != Method::gauss_newton && flight.pairs.empty() && !has_beliefs(flight);
  const int most_rounds = by_ceres ? 5 : k_max_rounds;
  struct Pace {
    Eigen::Vector3d last_m{0, 0, 0};
    double share{1.0};
  };
  std::vector<Pace> paces(start.anchors.size());
  for (fit.rounds = 0; fit.rounds < most_rounds && !fit.converged; ++fit.rounds) {
    if (options.canceled && options.canceled()) return make_error(Errc::canceled, "canceled");
    // Wide at first: the scale of residuals far from the answer says nothing about the noise.
    const double floor_m = fit.rounds == 0 ? 0.5 : fit.rounds == 1 ? 0.25 : 0.0;
    // Scales measured anew in every round would keep the last millimetres wandering.
    fit.normal = build_normal(flight, fit.state, options, floor_m,
                              fit.rounds > k_scale_rounds ? &fit.normal : nullptr);
    const JointNormal& normal = fit.normal;
    const bool coupled = !flight.pairs.empty();
    Eigen::VectorXd all_steps;
    SharedVector step;
    if (coupled) {
      const DenseNormal dense = dense_normal(flight, fit.state, normal, prior, options);
      all_steps = dense.matrix.ldlt().solve(dense.gradient);
      step = all_steps.tail<6>();
    } else {
      const SharedMatrix system = normal.reduced + prior.information;
      step =
          system.ldlt().solve(normal.reduced_gradient + prior.information * (prior.mean - fit.state.shared));
    }
    if (!step.allFinite()) step.setZero();
    step[k_shared_bias] = clipped(step[k_shared_bias], 0.5);
    step[k_shared_curve] = clipped(step[k_shared_curve], 0.05);
    step[k_shared_lag] = clipped(step[k_shared_lag], 0.1);
    for (const int arm : {k_shared_lever, k_shared_forward, k_shared_left})
      step[arm] = clipped(step[arm], 0.1);
    double largest = step.cwiseAbs().maxCoeff();
    for (std::size_t i = 0; i < fit.state.anchors.size(); ++i) {
      auto& anchor = fit.state.anchors[i];
      if (!anchor.active) continue;
      const AnchorBlock& block = normal.anchors[i];
      Eigen::Vector4d own = coupled ? Eigen::Vector4d(all_steps.segment<4>(4 * static_cast<Eigen::Index>(i)))
                                    : block.own_inverse * (block.gradient - block.shared * step);
      const double length = own.head<3>().norm();
      if (!own.allFinite()) continue;
      if (length > 1.0) own *= 1.0 / length;
      // Height near the plane of the track: the full step overshoots to the other side and back, for ever.
      Pace& pace = paces[i];
      pace.share = own.head<3>().dot(pace.last_m) < 0 ? 0.5 * pace.share : std::min(1.0, 1.5 * pace.share);
      pace.last_m = own.head<3>();
      own *= pace.share;
      anchor.position_m += own.head<3>();
      anchor.delay_m += own[3];
      largest = std::max(largest, own.cwiseAbs().maxCoeff());
    }
    fit.state.shared += step;
    // 0.1 mm; what still moves after many rounds is a direction nothing measures, and its covariance says so.
    const double enough = fit.rounds < 25 ? 1e-4 : 1e-3;
    fit.converged = fit.rounds >= 3 && largest < enough;
  }
  if (by_ceres) {
    BOOST_OUTCOME_TRY(fit.state, polish_joint_ceres(flight, std::move(fit.state), prior, options));
    fit.converged = true;
    fit.normal = build_normal(flight, fit.state, options, 0.0, nullptr, true);
  } else {
    const JointNormal scales = std::move(fit.normal);
    fit.normal = build_normal(flight, fit.state, options, 0.0, &scales, true);
  }
  if (!flight.pairs.empty()) {
    const DenseNormal dense = dense_normal(flight, fit.state, fit.normal, prior, options);
    const Eigen::Index n = dense.matrix.rows() - 6;
    const Eigen::MatrixXd covariance = dense.matrix.inverse();
    fit.shared_covariance = covariance.bottomRightCorner<6, 6>();
    fit.normal.reduced = fit.shared_covariance.inverse() - prior.information;
    for (Eigen::Index i = 0; i < n; i += 4) fit.anchor_covariance.emplace_back(covariance.block<4, 4>(i, i));
    return fit;
  }
  fit.shared_covariance = (fit.normal.reduced + prior.information).inverse();
  for (const AnchorBlock& block : fit.normal.anchors) {
    const Eigen::Matrix<double, 4, 6> lever = block.own_inverse * block.shared;
    fit.anchor_covariance.push_back(block.own_inverse + lever * fit.shared_covariance * lever.transpose());
  }
  return fit;
}

}  // namespace anchord
