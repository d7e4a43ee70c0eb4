#include "core/localize/accuracy_goal.hpp"

#include <cstdio>
#include <string_view>

namespace anchord {
namespace {

constexpr std::string_view k_missed = "not within the accuracy goal: ";

std::string missed(const char* which, double value_m, double limit_m) {
  char text[120];
  std::snprintf(text, sizeof text, "95 %% %s %.2f m (goal %.2f m)", which, value_m, limit_m);
  return text;
}

}  // namespace

void assess_goal(Estimate& estimate, const AccuracyGoal& goal) {
  std::erase_if(estimate.gates, is_goal);
  if (estimate.reason.starts_with(k_missed)) estimate.reason.clear();
  const auto add = [&](const char* name, double value, double limit) {
    Gate gate;
    gate.name = name;
    gate.limit = limit;
    if (estimate.best) gate.value = value;
    gate.passed = estimate.best && value <= limit;
    if (!estimate.best)
      gate.why = "there is no position yet";
    else if (!gate.passed)
      gate.why = estimate.largest_part;
    estimate.gates.push_back(std::move(gate));
  };
  add(k_goal_h95, estimate.h95_m, goal.h95_m);
  add(k_goal_v95, estimate.v95_m, goal.v95_m);
  if (estimate.verdict != Verdict::ok || !estimate.reason.empty() || estimate.largest_part.empty() ||
      holding_back(estimate) != nullptr)
    return;
  const bool wide = estimate.h95_m > goal.h95_m, tall = estimate.v95_m > goal.v95_m;
  if (!wide && !tall) return;
  estimate.reason = std::string(k_missed) +
                    (wide ? missed("horizontal", estimate.h95_m, goal.h95_m)
                          : missed("vertical", estimate.v95_m, goal.v95_m)) +
                    "; " + estimate.largest_part;
}

}  // namespace anchord
