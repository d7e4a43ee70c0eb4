#pragma once

#include <vector>

#include "api/formats/labelled_table.hpp"
#include "core/nlos/rule_table.hpp"

namespace anchord::api {

/// What the rules of chapter 5 look at, row by row of the table; the range's sd is that of its placement,
/// from 3 repeats on. Empty where the table has no labels.
std::vector<nlos::RuleSample> rule_samples(const LabelledTable& table);

}  // namespace anchord::api
