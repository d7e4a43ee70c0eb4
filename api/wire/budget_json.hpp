#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/base/ids.hpp"
#include "core/localize/error_budget.hpp"

namespace anchord {

/// {"trace_m2", "sources": {word: {"variance_m2", "share"} or null}, "largest", "help", "help_text"}.
/// base_known  false: nobody stated how good the base's coordinates are, and its source is null
nlohmann::ordered_json budget_json(const ErrorBudget& budget, bool base_known);

/// Of one anchor, as a calibration's provenance keeps it under "budgets"; null where there is none.
nlohmann::ordered_json kept_budget(const nlohmann::ordered_json& provenance, NetworkId anchor);

}  // namespace anchord
