#pragma once

#include <string>
#include <vector>

#include "core/nlos/rule_table.hpp"

namespace anchord::api {

/// The rules on one data set: with the dissertation's thresholds, and with thresholds fitted to its other
/// places.
struct RuleReport {
  std::string data_set{};
  std::size_t los_rows{}, nlos_rows{};
  nlos::RuleRow printed{}, fitted{};
  nlos::RuleSet rules{};  ///< fitted to all rows: the thresholds to use
};

/// Tables 5.2 and 5.3: one line a data set and class, one column a rule, per cent of right decisions, X where
/// a rule has nothing to look at.
std::string rules_text(const std::vector<RuleReport>& reports);
std::string rules_json(const std::vector<RuleReport>& reports);

}  // namespace anchord::api
