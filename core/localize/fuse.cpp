#include "core/localize/fuse.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

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
    const Gate agreement = flights_gate(chi2, n_ok);
    if (!agreement.passed) {
      out.verdict = Verdict::diverged;
      out.reason = "the flights contradict each other: " + agreement.why;
    }
    out.gates.push_back(agreement);
  }
  const ErrorEllipse ellipse = error_ellipse(best.covariance_m2);
  out.h95_m = ellipse.h95_m;
  out.v95_m = ellipse.v95_m;
  return out;
}

}  // namespace anchord
