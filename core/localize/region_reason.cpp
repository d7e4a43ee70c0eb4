#include "core/localize/region_reason.hpp"

#include <algorithm>
#include <cstdio>
#include <string_view>

namespace anchord {
namespace {

constexpr std::string_view k_opening = "the largest part of its uncertainty is ";

std::string largest_part(const ErrorBudget& budget) {
  const std::string_view source = source_text(budget.largest()), help = help_text(budget.help());
  const std::string article = budget.largest() == ErrorSource::floor ? "" : "the ";
  char share[32];
  std::snprintf(share, sizeof share, " (%.0f %%)", 100 * budget.share(budget.largest()));
  return std::string(k_opening) + article + std::string(source) + share +
         ", and what would help most: " + std::string(help);
}

/// Last in the text, in place of what another budget said.
void append(std::string& text, const std::string& part) {
  if (const auto before = text.find(k_opening); before != std::string::npos) {
    text.resize(before);
    if (text.ends_with("; ")) text.resize(text.size() - 2);
  }
  text += (text.empty() ? "" : "; ") + part;
}

}  // namespace

void name_largest_part(Estimate& estimate, const ErrorBudget& budget) {
  if (!estimate.best) return;
  estimate.largest_part = largest_part(budget);
  const auto precision = std::ranges::find(estimate.gates, "precision", &Gate::name);
  const bool wide = precision != estimate.gates.end() && !precision->passed;
  if (wide) append(precision->why, estimate.largest_part);
  if (wide && estimate.reason.empty())
    estimate.reason = "its region of uncertainty is too large for its distance";
  if (wide || estimate.verdict == Verdict::weak_geometry) append(estimate.reason, estimate.largest_part);
}

}  // namespace anchord
