#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/planning/next_point.hpp"

namespace anchord::api {

/// One question to the planner, as docs/formats.md ("Planner input") describes it.
struct PlanRequest {
  planning::NextPointInput input;
  planning::NextPointOptions options;
};

/// Reads it. Everything that is wrong is reported at once, each with its JSON pointer; then nothing is
/// returned. Unknown fields are refused: a typo is how a setting gets lost. Never throws.
std::optional<PlanRequest> read_plan_input(std::string_view json, std::vector<FieldError>& errors);

}  // namespace anchord::api
