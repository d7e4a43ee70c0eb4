#include "core/procedure/exit_rule.hpp"

#include "core/procedure/sentence.hpp"

namespace anchord::procedure {
namespace {

std::optional<std::string> goal(const ExitRule& rule, const Progress& now) {
  if (now.iterations < rule.min_iterations) return std::nullopt;
  if (rule.target_sigma_m && now.sigma_m && *now.sigma_m <= *rule.target_sigma_m) {
    return sentence("accuracy reached: %.3f m, target %.3f m", *now.sigma_m, *rule.target_sigma_m);
  }
  if (rule.gdop_root && now.gdop_root && *now.gdop_root <= *rule.gdop_root) {
    return sentence("GDOP (root) reached: %.3f, target %.3f", *now.gdop_root, *rule.gdop_root);
  }
  return std::nullopt;
}

}  // namespace

std::optional<Exit> exit_of(const ExitRule& rule, const Progress& now) {
  const auto reached = goal(rule, now);
  if (now.battery && *now.battery <= rule.min_battery) {
    return Exit{reached.has_value(), sentence("battery at %.0f %%, return at %.0f %%", 100 * *now.battery,
                                              100 * rule.min_battery)};
  }
  if (reached) return Exit{true, *reached};
  if (rule.max_s && now.elapsed_s >= *rule.max_s) {
    return Exit{false, sentence("flight time used up: %.0f s of %.0f s", now.elapsed_s, *rule.max_s)};
  }
  if (now.iterations >= rule.max_iterations) {
    return Exit{false, sentence("%.0f of %.0f points measured without reaching the target", now.iterations,
                                rule.max_iterations)};
  }
  return std::nullopt;
}

}  // namespace anchord::procedure
