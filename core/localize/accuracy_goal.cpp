#include "core/localize/accuracy_goal.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace anchord {
namespace {

constexpr std::string_view k_missed = "not within the accuracy goal: ";

std::string text(const char* format, double a, double b = 0) {
  std::array<char, 120> out{};
  std::snprintf(out.data(), out.size(), format, a, b);
  return out.data();
}

Gate gate(const Estimate& estimate, const char* name, std::optional<double> value, double limit) {
  Gate out;
  out.name = name;
  out.limit = limit;
  if (estimate.best && value && std::isfinite(*value)) out.value = value;
  out.passed = out.value && *out.value <= limit;
  if (!estimate.best) out.why = "there is no position yet";
  return out;
}

std::string missed(const Gate& gate) {
  if (gate.name == k_goal_sigma)
    return text("sigma of the position %.2f m (target %.2f m)", gate.value.value_or(0), gate.limit);
  return text(gate.name == k_goal_h95 ? "95 %% horizontal %.2f m (goal %.2f m)"
                                      : "95 %% vertical %.2f m (goal %.2f m)",
              gate.value.value_or(0), gate.limit);
}

}  // namespace

AnchorGoal anchor_goal(NetworkId anchor, std::span<const PlanTargets> flown, const AccuracyGoal& site) {
  for (const auto& targets : flown) {
    if (const auto own = targets.of_anchor.find(anchor); own != targets.of_anchor.end())
      return {GoalSource::anchor_target, own->second, site};
  }
  for (const auto& targets : flown) {
    if (targets.sigma_m) return {GoalSource::plan_target, targets.sigma_m, site};
  }
  return {site == AccuracyGoal{} ? GoalSource::standard : GoalSource::site, std::nullopt, site};
}

std::string goal_words(const AnchorGoal& goal) {
  if (goal.sigma_m)
    return text(goal.source == GoalSource::anchor_target
                    ? "target of the anchor in the flown plan, sigma of the position %.4g m"
                    : "target of the flown plan, sigma of the position %.4g m",
                *goal.sigma_m);
  return text(goal.source == GoalSource::site
                  ? "goal of the site, 95 %% %.4g m horizontal and %.4g m vertical"
                  : "default goal, 95 %% %.4g m horizontal and %.4g m vertical",
              goal.bounds.h95_m, goal.bounds.v95_m);
}

std::optional<double> position_sigma_m(const Estimate& estimate) {
  if (!estimate.best) return std::nullopt;
  const double trace = estimate.best->covariance_m2.trace();
  return std::isfinite(trace) && trace >= 0 ? std::optional(std::sqrt(trace)) : std::nullopt;
}

std::vector<Gate> goal_gates(const Estimate& estimate, const AnchorGoal& goal) {
  if (goal.sigma_m) return {gate(estimate, k_goal_sigma, position_sigma_m(estimate), *goal.sigma_m)};
  return {gate(estimate, k_goal_h95, estimate.h95_m, goal.bounds.h95_m),
          gate(estimate, k_goal_v95, estimate.v95_m, goal.bounds.v95_m)};
}

void assess_goal(Estimate& estimate, const AnchorGoal& goal) {
  std::erase_if(estimate.gates, is_goal);
  if (estimate.reason.starts_with(k_missed)) estimate.reason.clear();
  const bool free = estimate.verdict == Verdict::ok && estimate.reason.empty() &&
                    !estimate.largest_part.empty() && holding_back(estimate) == nullptr;
  for (auto& one : goal_gates(estimate, goal)) {
    if (estimate.best && !one.passed) {
      if (free && one.value && estimate.reason.empty())
        estimate.reason = std::string(k_missed) + missed(one) + "; " + estimate.largest_part;
      one.why = estimate.largest_part;
    }
    estimate.gates.push_back(std::move(one));
  }
}

const Gate* holding_back(const Estimate& estimate) {
  const auto at =
      std::ranges::find_if(estimate.gates, [](const Gate& gate) { return !gate.passed && !is_goal(gate); });
  return at == estimate.gates.end() ? nullptr : &*at;
}

bool reached_goal(const Estimate& estimate) {
  const auto goals = std::ranges::count_if(estimate.gates, is_goal);
  return estimate.acceptable() && goals > 0 && std::ssize(estimate.gates) > goals;
}

}  // namespace anchord
