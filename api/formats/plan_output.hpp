#pragma once

#include <string>

#include "api/formats/plan_input.hpp"
#include "core/planning/next_point.hpp"

namespace anchord::api {

/// The decision with every candidate's value, as docs/formats.md ("Planner output") describes it; ends in a
/// newline.
std::string decision_json(const planning::Decision& decision, const PlanRequest& request);
/// The same as a table for people.
std::string decision_text(const planning::Decision& decision, const PlanRequest& request);

}  // namespace anchord::api
