#include "core/procedure/why_not_done.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/localize/accuracy_goal.hpp"
#include "core/procedure/sentence.hpp"

namespace anchord::procedure {
namespace {

/// Widest part of the horizon, in degrees, from which the anchor was not seen.
double widest_gap_deg(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& from) {
  std::vector<double> angles;
  for (const auto& p : points) angles.push_back(std::atan2(p.y() - from.y(), p.x() - from.x()));
  if (angles.size() < 2) return 360;
  std::sort(angles.begin(), angles.end());
  double gap = angles.front() + 2 * std::numbers::pi - angles.back();
  for (std::size_t i = 1; i < angles.size(); ++i) gap = std::max(gap, angles[i] - angles[i - 1]);
  return gap * 180 / std::numbers::pi;
}

}  // namespace

std::string why_not_done(const std::optional<Estimate>& estimate, std::span<const Eigen::Vector3d> points,
                         const ExitRule& rule) {
  constexpr double k_flat_m = 2, k_one_side_deg = 230, k_nlos_share = 0.4, k_bias_m = 0.1;
  if (!estimate || !estimate->best) {
    return sentence("too few ranges yet: %.0f used", estimate ? static_cast<double>(estimate->n_used) : 0.0);
  }
  const auto& at = estimate->best->position.m;
  if (estimate->mirror) {
    return sentence(
        "mirror: a solution %.1f m away fits as well; measure at another height or from another side",
        (estimate->mirror->position.m - at).norm());
  }
  if (!points.empty()) {
    const auto [low, high] = std::minmax_element(points.begin(), points.end(),
                                                 [](const auto& a, const auto& b) { return a.z() < b.z(); });
    if (high->z() - low->z() < k_flat_m) {
      return sentence("flat flight: all points within %.1f m of height, its height cannot be determined",
                      high->z() - low->z());
    }
    const double gap = widest_gap_deg(points, at);
    if (gap > k_one_side_deg)
      return sentence("seen from one side only: %.0f degrees of the horizon are empty", gap);
  }
  std::size_t refused = 0;
  for (const auto& [reason, count] : estimate->refused) refused += count;
  const auto all = static_cast<double>(refused + estimate->n_used);
  if (all > 0 && static_cast<double>(refused) / all > k_nlos_share) {
    return sentence("too many ranges rejected: %.0f of %.0f", static_cast<double>(refused), all);
  }
  if (estimate->bias_sigma_m && *estimate->bias_sigma_m > k_bias_m) {
    return sentence("bias and position cannot be distinguished: bias known to %.2f m",
                    *estimate->bias_sigma_m);
  }
  const auto sigma = position_sigma_m(*estimate);
  if (sigma && rule.target_sigma_m && *sigma > *rule.target_sigma_m) {
    return sentence("accuracy %.3f m, target %.3f m", *sigma, *rule.target_sigma_m);
  }
  if (estimate->verdict != Verdict::ok)
    return estimate->reason.empty() ? "verdict not ok yet" : estimate->reason;
  if (const Gate* gate = holding_back(*estimate)) return gate->why;
  return estimate->reason.empty() ? "more points needed" : estimate->reason;
}

}  // namespace anchord::procedure
