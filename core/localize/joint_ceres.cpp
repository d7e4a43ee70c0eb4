#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "core/localize/joint_model.hpp"
#include "core/localize/residual.hpp"

namespace anchord {
namespace {

using Four = std::array<double, 4>;

/// All ranges of one anchor and the prior on its delay. Scales and tempering stay as they were at the start
/// of the round, so that Ceres sees one smooth problem.
class AnchorRanges final : public ceres::CostFunction {
 public:
  AnchorRanges(const FlightRows& flight, const AnchorRows& rows, const AnchorBlock& block,
               const FlightOptions& options, std::vector<double> sigma_m)
      : flight_(flight), rows_(rows), options_(options), kappa_(block.kappa), sigma_m_(std::move(sigma_m)) {
    mutable_parameter_block_sizes()->push_back(4);
    mutable_parameter_block_sizes()->push_back(k_shared_size);
    set_num_residuals(static_cast<int>(rows.rows.size()) + 1);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector4d> own(parameters[0]);
    const Eigen::Map<const SharedVector> shared(parameters[1]);
    const JointState::Anchor anchor{own.head<3>(), own[3], true};
    double* by_own = jacobians ? jacobians[0] : nullptr;
    double* by_shared = jacobians ? jacobians[1] : nullptr;
    const double bend =
        default_bend(options_.loss) * (options_.loss == Loss::tukey ? options_.mad_factor : 1.0);
    const std::size_t n = rows_.rows.size();
    for (std::size_t i = 0; i < n; ++i) {
      const JointLine line = linearise(flight_.track, rows_.rows[i], shared, anchor);
      double slope = 0;
      residuals[i] = 0;
      if (line.refused == TrackRefusal::none) {
        const double factor = options_.weights == Weights::as_printed
                                  ? std::sqrt(sigma_m_[i] / std::sqrt(k_variance_los_m2))
                                  : 1.0;
        const double e = line.residual_m / sigma_m_[i];
        const LossValue value = loss_value(options_.loss, bend, e);
        const double size = std::sqrt(value.rho);
        const double scale = factor / std::sqrt(kappa_);
        residuals[i] = scale * std::copysign(size, e);
        slope = scale * (size > 1e-12 ? value.weight * std::abs(e) / size : 1.0) / sigma_m_[i];
      }
      if (by_own) Eigen::Map<Eigen::Vector4d>(by_own + 4 * i) = -slope * line.by_anchor;
      if (by_shared)
        Eigen::Map<SharedVector>(by_shared + k_shared_size * static_cast<std::ptrdiff_t>(i)) =
            -slope * line.by_shared;
    }
    residuals[n] = own[3] / options_.delay_prior_m;
    if (by_own) Eigen::Map<Eigen::Vector4d>(by_own + 4 * n) << 0, 0, 0, 1.0 / options_.delay_prior_m;
    if (by_shared)
      Eigen::Map<SharedVector>(by_shared + k_shared_size * static_cast<std::ptrdiff_t>(n)).setZero();
    return true;
  }

 private:
  const FlightRows& flight_;
  const AnchorRows& rows_;
  const FlightOptions& options_;
  double kappa_;
  std::vector<double> sigma_m_;
};

/// What priors beside the ranges ask of one anchor.
class PriorTerm final : public ceres::SizedCostFunction<3, 4> {
 public:
  PriorTerm(AnchorPriors priors, const FlightOptions& options)
      : priors_(std::move(priors)), options_(options) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Vector3d place_m(parameters[0][0], parameters[0][1], parameters[0][2]);
    const auto rows = prior_rows(priors_, options_.outline_m, options_.outline_sigma_m, place_m);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      residuals[i] = -rows[i].missing;
      if (jacobians && jacobians[0]) Eigen::Map<Eigen::Vector4d>(jacobians[0] + 4 * i) << rows[i].slope, 0.0;
    }
    return true;
  }

 private:
  AnchorPriors priors_;
  const FlightOptions& options_;
};

/// The Gaussian prior on the shared unknowns: L^T (phi - mu) with information = L L^T.
class SharedTerm final : public ceres::SizedCostFunction<k_shared_size, k_shared_size> {
 public:
  explicit SharedTerm(const SharedPrior& prior) : mean_(prior.mean) {
    root_ = SharedMatrix(prior.information.llt().matrixL()).transpose();
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    Eigen::Map<SharedVector>{residuals} = root_ * (Eigen::Map<const SharedVector>(parameters[0]) - mean_);
    if (jacobians && jacobians[0]) {
      Eigen::Map<Eigen::Matrix<double, k_shared_size, k_shared_size, Eigen::RowMajor>>{jacobians[0]} = root_;
    }
    return true;
  }

 private:
  SharedVector mean_;
  SharedMatrix root_;
};

/// Sigma of every row: the anchor's residual scale, widened by what its position is worse than usual.
std::vector<double> sigmas(const FlightRows& flight, const AnchorRows& rows, const JointState& state,
                           std::size_t index, const AnchorBlock& block) {
  std::vector<double> sigma_m;
  for (const JointRow& row : rows.rows) {
    const JointLine line = linearise(flight.track, row, state.shared, state.anchors[index]);
    const double extra_m2 = std::max(line.position_variance_m2 - block.usual_position_variance_m2, 0.0);
    sigma_m.push_back(std::sqrt(block.scale_m * block.scale_m + extra_m2));
  }
  return sigma_m;
}

}  // namespace

Result<JointState> polish_joint_ceres(const FlightRows& flight, JointState state, const SharedPrior& prior,
                                      const FlightOptions& options, bool& settled,
                                      const JointNormal* scales_from) {
  settled = false;
  for (int round = 0; round < 20; ++round) {
    if (options.canceled && options.canceled()) return make_error(Errc::canceled, "canceled");
    const JointNormal normal = build_normal(flight, state, options, 0.0, scales_from);
    ceres::Problem problem;
    SharedVector shared = state.shared;
    std::vector<Four> own(state.anchors.size());
    problem.AddParameterBlock(shared.data(), k_shared_size);
    if (options.lever_across_prior_m <= 0)
      problem.SetManifold(shared.data(),
                          new ceres::SubsetManifold(k_shared_size, {k_shared_forward, k_shared_left}));
    problem.AddResidualBlock(new SharedTerm(prior), nullptr, shared.data());
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    ordering->AddElementToGroup(shared.data(), 1);
    for (std::size_t i = 0; i < state.anchors.size(); ++i) {
      const auto& anchor = state.anchors[i];
      if (!anchor.active || normal.anchors[i].n_in_track == 0) continue;
      own[i] = {anchor.position_m.x(), anchor.position_m.y(), anchor.position_m.z(), anchor.delay_m};
      problem.AddParameterBlock(own[i].data(), 4);
      if (options.dims == Dims::two) problem.SetManifold(own[i].data(), new ceres::SubsetManifold(4, {2}));
      problem.AddResidualBlock(
          new AnchorRanges(flight, flight.anchors[i], normal.anchors[i], options,
                           sigmas(flight, flight.anchors[i], state, i, normal.anchors[i])),
          nullptr, own[i].data(), shared.data());
      if (!options.priors.empty() || !options.outline_m.empty()) {
        problem.AddResidualBlock(new PriorTerm(priors_of(flight.anchors[i].id, options), options), nullptr,
                                 own[i].data());
      }
      ordering->AddElementToGroup(own[i].data(), 0);
    }
    ceres::Solver::Options ceres_options;
    ceres_options.linear_solver_type = ceres::DENSE_SCHUR;
    ceres_options.linear_solver_ordering = ordering;
    ceres_options.trust_region_strategy_type =
        options.method == Method::dogleg ? ceres::DOGLEG : ceres::LEVENBERG_MARQUARDT;
    ceres_options.max_num_iterations = 50;
    ceres_options.function_tolerance = 1e-14;
    ceres_options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(ceres_options, &problem, &summary);
    if (!summary.IsSolutionUsable()) return make_error(Errc::no_convergence, summary.message);
    double largest = (shared - state.shared).cwiseAbs().maxCoeff();
    state.shared = shared;
    for (std::size_t i = 0; i < own.size(); ++i) {
      if (!state.anchors[i].active || normal.anchors[i].n_in_track == 0) continue;
      const Eigen::Vector3d position(own[i][0], own[i][1], own[i][2]);
      largest = std::max(largest, (position - state.anchors[i].position_m).norm());
      state.anchors[i].position_m = position;
      state.anchors[i].delay_m = own[i][3];
    }
    settled = largest < 1e-3;
    if (largest < 1e-5) break;
  }
  return state;
}

}  // namespace anchord
