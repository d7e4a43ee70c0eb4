#pragma once

#include "core/localize/error_budget.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Puts the largest part of the budget, and what would help most, into the estimate: largest_part, and behind
/// what withholds it for the size of its region (verdict weak_geometry and gate precision, into the reason
/// and the gate's why). A later budget, such as that of a fusion, takes the place of an earlier one.
void name_largest_part(Estimate& estimate, const ErrorBudget& budget);

}  // namespace anchord
