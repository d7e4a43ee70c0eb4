#include "core/localize/error_budget.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/localize/held_height.hpp"

namespace anchord {
namespace {

/// Which groups of the unknowns are known, as bits.
constexpr unsigned k_bias = 1, k_clock = 2, k_lever = 4, k_all = 7;

bool is_known(int shared, unsigned known) {
  switch (shared) {
    case k_shared_bias:
    case k_shared_curve:
      return (known & k_bias) != 0;
    case k_shared_lag:
      return (known & k_clock) != 0;
    default:
      return (known & k_lever) != 0;
  }
}

std::vector<int> unknown_shared(unsigned known) {
  std::vector<int> out;
  for (int i = 0; i < k_shared_size; ++i) {
    if (!is_known(i, known)) out.push_back(i);
  }
  return out;
}

/// Inverse of an anchor's own block, with its delay or with that known (then its row is zero).
Eigen::Matrix4d own_inverse(const AnchorBlock& block, bool delay_known) {
  if (!delay_known) return block.own_inverse;
  Eigen::Matrix3d own = block.own.topLeftCorner<3, 3>();
  own.diagonal().array() += 1e-6 * own.diagonal().maxCoeff() + 1e-12;  // as in build_normal
  Eigen::Matrix4d out = Eigen::Matrix4d::Zero();
  out.topLeftCorner<3, 3>() = own.ldlt().solve(Eigen::Matrix3d::Identity());
  return out;
}

using Covariances = std::vector<Eigen::Matrix3d>;

/// Covariance of every position given what is known, from the arrow.
Covariances by_arrow(const JointFit& fit, const SharedPrior& prior, unsigned known) {
  const std::vector<int> unknown = unknown_shared(known);
  const bool delay_known = (known & k_bias) != 0;
  std::vector<Eigen::Matrix4d> own;
  Eigen::MatrixXd system = (fit.normal.shared + prior.information)(unknown, unknown);
  for (const AnchorBlock& block : fit.normal.anchors) {
    own.push_back(own_inverse(block, delay_known));
    const Eigen::MatrixXd shared = block.shared(Eigen::all, unknown);
    system -= shared.transpose() * own.back() * shared;
  }
  const Eigen::MatrixXd inverse = unknown.empty() ? Eigen::MatrixXd(0, 0) : Eigen::MatrixXd(system.inverse());
  Covariances out;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const Eigen::MatrixXd gain = own[i] * fit.normal.anchors[i].shared(Eigen::all, unknown);
    const Eigen::MatrixXd all = own[i] + gain * inverse * gain.transpose();
    out.emplace_back(all.topLeftCorner<3, 3>());
  }
  return out;
}

/// The same where ranges between anchors couple them.
Covariances by_dense(const DenseNormal& dense, unsigned known) {
  const Eigen::Index n = dense.matrix.rows() - k_shared_size;
  std::vector<Eigen::Index> kept, at;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (i % 4 == 3 && (known & k_bias) != 0) continue;
    if (i % 4 == 0) at.push_back(static_cast<Eigen::Index>(kept.size()));
    kept.push_back(i);
  }
  for (const int i : unknown_shared(known)) kept.push_back(n + i);
  const Eigen::MatrixXd covariance = Eigen::MatrixXd(dense.matrix(kept, kept)).inverse();
  Covariances out;
  for (const Eigen::Index i : at) out.emplace_back(covariance.block<3, 3>(i, i));
  return out;
}

/// Share of C0 that stays with evenly spread directions: the harmonic over the arithmetic mean of its
/// eigenvalues.
double even_share(const Eigen::Matrix3d& covariance, bool plane) {
  const auto of = [](const auto& c, double axes) {
    const double product = c.trace() * c.inverse().trace();
    return std::isfinite(product) && product > 0 ? std::min(axes * axes / product, 1.0) : 0.0;
  };
  return plane ? of(Eigen::Matrix2d(covariance.topLeftCorner<2, 2>()), 2.0) : of(covariance, 3.0);
}

}  // namespace

std::string_view source_text(ErrorSource source) {
  switch (source) {
    case ErrorSource::ranging:
      return "noise of the ranges";
    case ErrorSource::geometry:
      return "geometry of the flight";
    case ErrorSource::bias:
      return "range bias";
    case ErrorSource::rtk:
      return "RTK positions";
    case ErrorSource::lever_arm:
      return "lever arm";
    case ErrorSource::clock:
      return "time lag";
    case ErrorSource::base:
      return "base station";
    case ErrorSource::floor:
      return "errors that no residual shows";
  }
  return "";
}

std::string_view help_text(BudgetHelp help) {
  switch (help) {
    case BudgetHelp::more_points:
      return "more points here: the noise of the ranges is the largest part";
    case BudgetHelp::other_height:
      return "points at another height: the height is the weak direction";
    case BudgetHelp::other_sides:
      return "points from other sides: a horizontal direction is weak";
    case BudgetHelp::calibrate_bias:
      return "calibrate the kit's range bias: more flights of the kit, or a profile";
    case BudgetHelp::better_rtk:
      return "better RTK: the positions of the aircraft are the largest part";
    case BudgetHelp::calibrate_arm:
      return "measure the lever arm from the GNSS antenna to the tag";
    case BudgetHelp::fix_clock:
      return "synchronise tag and rover, or fly slower: the time lag is the largest part";
    case BudgetHelp::survey_base:
      return "survey the base station: its coordinates shift all anchors alike";
    case BudgetHelp::check_points:
      return "check points surveyed independently: what remains is in no residual";
  }
  return "";
}

double ErrorBudget::trace_m2() const {
  double sum_m2 = 0;
  for (const auto& part : parts_m2) sum_m2 += part.trace();
  return sum_m2;
}

double ErrorBudget::share(ErrorSource source) const {
  const double whole_m2 = trace_m2();
  return whole_m2 > 0 ? trace_m2(source) / whole_m2 : 0.0;
}

ErrorSource ErrorBudget::largest() const {
  const auto at = std::ranges::max_element(parts_m2, {}, [](const Eigen::Matrix3d& m) { return m.trace(); });
  return static_cast<ErrorSource>(at - parts_m2.begin());
}

BudgetHelp ErrorBudget::help() const {
  switch (largest()) {
    case ErrorSource::ranging:
      return BudgetHelp::more_points;
    case ErrorSource::geometry:
      return std::abs(weak.z()) > std::sqrt(0.5) ? BudgetHelp::other_height : BudgetHelp::other_sides;
    case ErrorSource::bias:
      return BudgetHelp::calibrate_bias;
    case ErrorSource::rtk:
      return BudgetHelp::better_rtk;
    case ErrorSource::lever_arm:
      return BudgetHelp::calibrate_arm;
    case ErrorSource::clock:
      return BudgetHelp::fix_clock;
    case ErrorSource::base:
      return BudgetHelp::survey_base;
    case ErrorSource::floor:
      return BudgetHelp::check_points;
  }
  return BudgetHelp::check_points;
}

std::vector<ErrorBudget> error_budgets(const FlightRows& flight, const JointFit& fit,
                                       const SharedPrior& prior, const FlightOptions& options) {
  const bool plane = options.dims == Dims::two;
  std::array<Covariances, k_all + 1> given;
  if (flight.pairs.empty()) {
    for (unsigned known = 0; known <= k_all; ++known) given[known] = by_arrow(fit, prior, known);
  } else {
    const DenseNormal dense = dense_normal(flight, fit.state, fit.normal, prior, options);
    for (unsigned known = 0; known <= k_all; ++known) given[known] = by_dense(dense, known);
  }
  if (plane) {
    for (auto& covariances : given) {
      for (auto& c : covariances) {
        c.row(2).setZero();
        c.col(2).setZero();
      }
    }
  }
  std::vector<ErrorBudget> out;
  for (std::size_t i = 0; i < fit.normal.anchors.size(); ++i) {
    ErrorBudget budget;
    const auto shapley = [&](unsigned group) -> Eigen::Matrix3d {
      const unsigned others = k_all & ~group, one = others & (~others + 1U), two = others & ~one;
      const auto gone = [&](unsigned known) -> Eigen::Matrix3d {
        return given[known][i] - given[known | group][i];
      };
      return (2.0 * gone(0) + gone(one) + gone(two) + 2.0 * gone(others)) / 6.0;
    };
    budget.part(ErrorSource::bias) = shapley(k_bias);
    budget.part(ErrorSource::clock) = shapley(k_clock);
    budget.part(ErrorSource::lever_arm) = shapley(k_lever);
    Eigen::Matrix3d doubt = fit.anchor_covariance[i].topLeftCorner<3, 3>();
    if (plane) {
      doubt.row(2).setZero();
      doubt.col(2).setZero();
    }
    budget.part(ErrorSource::bias) += doubt - given[0][i];
    if (i < fit.arm_covariance_m2.size()) {
      budget.part(ErrorSource::bias) -= fit.arm_covariance_m2[i];
      budget.part(ErrorSource::lever_arm) += fit.arm_covariance_m2[i];
    }
    const Eigen::Matrix3d& left = given[k_all][i];
    const double even = even_share(left, plane);
    const AnchorBlock& block = fit.normal.anchors[i];
    const double track = std::clamp(
        block.usual_position_variance_m2 / std::max(block.scale_m * block.scale_m, 1e-12), 0.0, 1.0);
    budget.part(ErrorSource::geometry) = (1.0 - even) * left;
    budget.part(ErrorSource::rtk) = even * track * left;
    budget.part(ErrorSource::ranging) = even * (1.0 - track) * left;
    budget.part(ErrorSource::floor) =
        options.floor_sigma_m * options.floor_sigma_m * Eigen::Matrix3d::Identity();
    if (plane) budget.part(ErrorSource::floor) += held_height_m2(flight, fit, i, options);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(left);
    budget.weak = axes.eigenvectors().col(2);
    out.push_back(std::move(budget));
  }
  return out;
}

ErrorBudget fused_budget(std::span<const BudgetOf> flights, const Eigen::Matrix3d& fused_covariance_m2) {
  ErrorBudget out;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const auto& one : flights) information += one.covariance_m2.inverse();
  const Eigen::Matrix3d mean = information.inverse();
  const double wider = fused_covariance_m2.trace() / std::max(mean.trace(), 1e-300);
  double most = -1;
  for (const auto& one : flights) {
    const Eigen::Matrix3d gain = mean * one.covariance_m2.inverse();
    for (std::size_t k = 0; k < k_error_sources; ++k)
      out.parts_m2[k] += wider * gain * one.budget->parts_m2[k] * gain.transpose();
    const double weight = gain.trace();
    if (weight > most) {
      most = weight;
      out.weak = one.budget->weak;
    }
  }
  return out;
}

}  // namespace anchord
