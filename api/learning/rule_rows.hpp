#pragma once

#include <cstdint>
#include <string>

#include "api/learning/dataset_table.hpp"
#include "api/learning/rule_report.hpp"

namespace anchord::api {

/// The plain rules of chapter 5 on the labelled rows of a data set; fitted ones are judged on places they
/// were not fitted to. The range's sd is that of the setting, from three rows of it or from its aggregated
/// spread. errors: too_few_observations (no labelled row)
Result<RuleReport> rules_of(const DatasetTable& table, std::string name, Place group_by, std::uint64_t seed);

}  // namespace anchord::api
