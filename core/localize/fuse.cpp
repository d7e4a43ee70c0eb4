#include "core/localize/fuse.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/base/check.hpp"
#include "core/localize/error_ellipse.hpp"
#include "core/localize/gates.hpp"
#include "core/localize/held_height.hpp"

namespace anchord {
namespace {

/// Of each gate the answer that is hardest to pass: one that failed, else the first flight's.
std::vector<Gate> worst_gates(std::span<const Estimate* const> estimates) {
  std::vector<Gate> worst;
  for (const Estimate* estimate : estimates) {
    for (const Gate& gate : estimate->gates) {
      const auto known = std::ranges::find(worst, gate.name, &Gate::name);
      if (known == worst.end()) {
        worst.push_back(gate);
      } else if (known->passed && !gate.passed) {
        *known = gate;
      }
    }
  }
  return worst;
}

/// The common answer against flights that leave open which of two places is the anchor's: of each its nearer
/// place, horizontally. The flight that contradicts most; nothing where none is further off than both claim,
/// twice over, for what an ambiguous flight claims is of one place alone.
std::optional<Gate> contradicted(std::span<const Estimate> estimates, const Hypothesis& common,
                                 double h95_m) {
  std::optional<Gate> worst;
  for (const Estimate& estimate : estimates) {
    if (estimate.verdict != Verdict::ambiguous || !estimate.best) continue;
    double nearest_chi2 = std::numeric_limits<double>::infinity(), apart_m = 0;
    for (const auto* place : {&estimate.best, &estimate.mirror}) {
      if (!*place) continue;
      const Eigen::Vector2d off = ((*place)->position.m - common.position.m).head<2>();
      const Eigen::Matrix2d both =
          (*place)->covariance_m2.topLeftCorner<2, 2>() + common.covariance_m2.topLeftCorner<2, 2>();
      const double chi2 = off.dot(both.inverse() * off);
      if (!(chi2 < nearest_chi2)) continue;
      nearest_chi2 = chi2;
      apart_m = off.norm();
    }
    if (!std::isfinite(nearest_chi2) || apart_m <= 2 * (estimate.h95_m + h95_m)) continue;
    Gate gate = ambiguous_flight_gate(nearest_chi2, apart_m);
    if (!gate.passed && (!worst || *gate.value > *worst->value)) worst = std::move(gate);
  }
  return worst;
}

void contradict(Estimate& estimate, Gate gate) {
  estimate.verdict = Verdict::diverged;
  estimate.reason = "the flights contradict each other: " + gate.why;
  std::erase_if(estimate.gates, [&](const Gate& known) { return known.name == gate.name; });
  estimate.gates.push_back(std::move(gate));
}

}  // namespace

Estimate fuse_estimates(std::span<const Estimate> estimates) {
  ANCHORD_CHECK(!estimates.empty(), "nothing to fuse");
  if (estimates.size() == 1) return estimates.front();
  Estimate out;
  const Estimate* chosen = &estimates.front();
  double smallest = std::numeric_limits<double>::infinity();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero();
  std::size_t n_ok = 0;
  for (const auto& estimate : estimates) {
    if (estimate.best && estimate.h95_m < smallest) {
      smallest = estimate.h95_m;
      chosen = &estimate;
    }
    if (estimate.verdict != Verdict::ok || !estimate.best) continue;
    const Eigen::Matrix3d inverse = estimate.best->covariance_m2.inverse();
    if (!inverse.allFinite()) continue;
    information += inverse;
    weighted += inverse * estimate.best->position.m;
    ++n_ok;
  }
  out = *chosen;
  out.n_used = 0;
  out.refused.clear();
  for (const auto& estimate : estimates) {
    out.n_used += estimate.n_used;
    for (const auto& [reason, n] : estimate.refused) out.refused[reason] += n;
    out.time = std::max(out.time, estimate.time);
  }
  if (n_ok == 0) return out;
  Eigen::Matrix3d covariance = information.inverse();
  const Eigen::Vector3d mean = covariance * weighted;
  double chi2 = 0, rms2 = 0;
  for (const auto& estimate : estimates) {
    if (estimate.verdict != Verdict::ok || !estimate.best) continue;
    const Eigen::Vector3d off = estimate.best->position.m - mean;
    chi2 += off.dot(estimate.best->covariance_m2.inverse() * off);
    rms2 += estimate.best->rms_residual_m * estimate.best->rms_residual_m;
  }
  std::vector<const Estimate*> counted;
  for (const auto& estimate : estimates) {
    if (estimate.verdict == Verdict::ok && estimate.best) counted.push_back(&estimate);
  }
  out.gates = worst_gates(counted);
  hold_height_sigma(counted, covariance);
  const double dof = 3.0 * static_cast<double>(n_ok - 1);
  Hypothesis best;
  best.position.m = mean;
  best.covariance_m2 = covariance * (dof > 0 ? std::max(1.0, chi2 / dof) : 1.0);
  best.rms_residual_m = std::sqrt(rms2 / static_cast<double>(n_ok));
  out.best = best;
  out.mirror.reset();
  out.verdict = Verdict::ok;
  out.reason.clear();
  if (dof > 0) {
    Gate agreement = flights_gate(chi2, n_ok);
    if (agreement.passed)
      out.gates.push_back(std::move(agreement));
    else
      contradict(out, std::move(agreement));
  }
  const ErrorEllipse ellipse = error_ellipse(best.covariance_m2);
  out.h95_m = ellipse.h95_m;
  out.v95_m = ellipse.v95_m;
  if (auto gate = contradicted(estimates, best, out.h95_m); gate && out.verdict == Verdict::ok)
    contradict(out, std::move(*gate));
  return out;
}

}  // namespace anchord
