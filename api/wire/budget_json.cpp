#include "api/wire/budget_json.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

namespace anchord {
namespace {

using Ordered = nlohmann::ordered_json;

/// Six significant digits: shares of a covariance mean no more.
Ordered number(double value) {
  if (!std::isfinite(value)) return nullptr;
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return std::strtod(text, nullptr);
}

}  // namespace

Ordered budget_json(const ErrorBudget& budget, bool base_known) {
  Ordered sources = Ordered::object();
  for (const auto& [word, source] : k_error_source_words) {
    Ordered& one = sources[std::string(word)];
    if (source == ErrorSource::base && !base_known) continue;
    one = {{"variance_m2", number(budget.trace_m2(source))}, {"share", number(budget.share(source))}};
  }
  return {{"trace_m2", number(budget.trace_m2())},
          {"sources", std::move(sources)},
          {"largest", k_error_source_words.word(budget.largest())},
          {"help", k_budget_help_words.word(budget.help())},
          {"help_text", help_text(budget.help())}};
}

Ordered kept_budget(const Ordered& provenance, NetworkId anchor) {
  if (!provenance.is_object()) return nullptr;
  const Ordered::json_pointer at("/budgets/" + to_string(anchor));
  return provenance.contains(at) ? provenance[at] : Ordered(nullptr);
}

}  // namespace anchord
