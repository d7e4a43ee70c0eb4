#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/localize/joint_rounds.hpp"

namespace anchord {
namespace {

constexpr int k_max_rounds = 60;
constexpr int k_scale_rounds = 20;
// Wide at first: the scale of residuals far from the answer says nothing about the noise.
constexpr double k_first_floor_m = 0.5, k_second_floor_m = 0.25;

double clipped(double value, double limit) { return std::clamp(value, -limit, limit); }

bool has_error_models(const FlightRows& flight) {
  return std::ranges::any_of(flight.anchors, [](const AnchorRows& anchor) {
    return std::ranges::any_of(anchor.rows, [](const JointRow& row) { return row.error_model != nullptr; });
  });
}

/// How an anchor went in the rounds before.
struct Pace {
  Eigen::Vector3d last_m{0, 0, 0};
  double share{1.0};
};

/// One step of everything, on the normal equations of `fit`; the largest of its parts.
double take_step(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options,
                 std::vector<Pace>& paces, JointFit& fit) {
  const JointNormal& normal = fit.normal;
  const bool coupled = !flight.pairs.empty();
  Eigen::VectorXd all_steps;
  SharedVector step;
  if (coupled) {
    const DenseNormal dense = dense_normal(flight, fit.state, normal, prior, options);
    all_steps = dense.matrix.ldlt().solve(dense.gradient);
    step = all_steps.tail<k_shared_size>();
  } else {
    const SharedMatrix system = normal.reduced + prior.information;
    step = system.ldlt().solve(normal.reduced_gradient + prior.information * (prior.mean - fit.state.shared));
  }
  if (!step.allFinite()) step.setZero();
  step[k_shared_bias] = clipped(step[k_shared_bias], 0.5);
  step[k_shared_curve] = clipped(step[k_shared_curve], 0.05);
  step[k_shared_lag] = clipped(step[k_shared_lag], 0.1);
  for (int arm = k_shared_lever; arm < k_shared_size; ++arm) step[arm] = clipped(step[arm], 0.1);
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
  return largest;
}

/// Of the anchors and of what they share, from the normal equations of the answer.
void fill_covariances(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options,
                      JointFit& fit) {
  if (!flight.pairs.empty()) {
    const DenseNormal dense = dense_normal(flight, fit.state, fit.normal, prior, options);
    const Eigen::Index n = dense.matrix.rows() - k_shared_size;
    const Eigen::MatrixXd covariance = dense.matrix.inverse();
    fit.shared_covariance = covariance.bottomRightCorner<k_shared_size, k_shared_size>();
    fit.normal.reduced = fit.shared_covariance.inverse() - prior.information;
    for (Eigen::Index i = 0; i < n; i += 4) fit.anchor_covariance.emplace_back(covariance.block<4, 4>(i, i));
    return;
  }
  fit.shared_covariance = (fit.normal.reduced + prior.information).inverse();
  for (const AnchorBlock& block : fit.normal.anchors) {
    const Eigen::Matrix<double, 4, k_shared_size> lever = block.own_inverse * block.shared;
    fit.anchor_covariance.push_back(block.own_inverse + lever * fit.shared_covariance * lever.transpose());
  }
}

}  // namespace

JointNormal normal_at_start(const FlightRows& flight, const JointState& start, const FlightOptions& options) {
  return build_normal(flight, start, options, k_first_floor_m);
}

Result<JointFit> solve_joint(const FlightRows& flight, const JointState& start, const SharedPrior& prior,
                             const FlightOptions& options) {
  return solve_joint_from(flight, start, normal_at_start(flight, start, options), prior, options);
}

Result<JointFit> solve_joint_from(const FlightRows& flight, const JointState& start, JointNormal first,
                                  const SharedPrior& prior, const FlightOptions& options) {
  JointFit fit;
  fit.state = start;
  // The Gauss-Newton rounds bring every method near; Ceres then does the rest where it is asked for.
  // Ranges between anchors are solved here whatever the method: their network is small and dense. So are
  // ranges a model spoke about, whose likelihood is no sum of squares.
  const bool by_ceres =
      options.method != Method::gauss_newton && flight.pairs.empty() && !has_error_models(flight);
  const int most_rounds = by_ceres ? 5 : k_max_rounds;
  std::vector<Pace> paces(start.anchors.size());
  for (fit.rounds = 0; fit.rounds < most_rounds && !fit.converged; ++fit.rounds) {
    if (options.canceled && options.canceled()) return make_error(Errc::canceled, "canceled");
    // Scales measured anew in every round would keep the last millimetres wandering.
    if (fit.rounds == 0)
      fit.normal = std::move(first);
    else
      fit.normal = build_normal(flight, fit.state, options, fit.rounds == 1 ? k_second_floor_m : 0.0,
                                fit.rounds > k_scale_rounds ? &fit.normal : nullptr);
    const double largest = take_step(flight, prior, options, paces, fit);
    // 0.1 mm; what still moves after many rounds is a direction nothing measures, and its covariance says so.
    const double enough = fit.rounds < 25 ? 1e-4 : 1e-3;
    fit.converged = fit.rounds >= 3 && largest < enough;
  }
  // What the rounds leave wandering, a trust region settles; of the two kinds it cannot solve, the verdict
  // says that they wander.
  const bool wanders = !fit.converged && flight.pairs.empty() && !has_error_models(flight);
  const JointNormal scales = std::move(fit.normal);
  // Measured anew, the scales of a flight that wanders would lead it on to another answer.
  const JointNormal* kept = by_ceres ? nullptr : &scales;
  if (by_ceres || wanders) {
    BOOST_OUTCOME_TRY(fit.state,
                      polish_joint_ceres(flight, std::move(fit.state), prior, options, fit.converged, kept));
  }
  fit.normal = build_normal(flight, fit.state, options, 0.0, kept, true);
  fill_covariances(flight, prior, options, fit);
  return fit;
}

}  // namespace anchord
