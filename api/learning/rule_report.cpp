#include "api/learning/rule_report.hpp"

#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;
using nlos::k_rule_count;
using nlos::Rule;

std::string cell(const nlos::RuleRates& rates, bool los) {
  if ((los ? rates.los : rates.nlos) == 0) return "X";
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%.1f", 100 * (los ? rates.los_rate() : rates.nlos_rate()));
  return text.data();
}

std::string line(const std::string& data_set, const char* what, std::size_t rows, const nlos::RuleRow& row,
                 bool los) {
  std::array<char, 160> head{};
  std::snprintf(head.data(), head.size(), "%-28.28s %-8s %7zu", data_set.c_str(), what, rows);
  std::string out = head.data();
  for (const auto& one : row) {
    std::array<char, 24> text{};
    std::snprintf(text.data(), text.size(), " %9s", cell(one.rates, los).c_str());
    out += text.data();
  }
  return out + "\n";
}

constexpr std::array<const char*, k_rule_count> k_heads{"RSS",    "Kurtosis", "MED", "RMSDS",
                                                        "RMSDS*", "Std",      "FP",  "Weighted"};

std::string block(const std::vector<RuleReport>& reports, bool los) {
  std::string out = std::string{"\nRight decisions (%) on "} + (los ? "LOS" : "NLOS") + " measurements\n";
  std::array<char, 160> head{};
  std::snprintf(head.data(), head.size(), "%-28s %-8s %7s", "data set", "rules", "meas.");
  out += head.data();
  for (const char* name : k_heads) {
    std::snprintf(head.data(), head.size(), " %9s", name);
    out += head.data();
  }
  out += "\n";
  for (const auto& r : reports) {
    const std::size_t rows = los ? r.los_rows : r.nlos_rows;
    out += line(r.data_set, "printed", rows, r.printed, los);
    out += line(r.data_set, "fitted", rows, r.fitted, los);
  }
  return out;
}

Ordered rates_json(const nlos::RuleRow& row) {
  Ordered out = Ordered::object();
  for (const auto& [word, rule] : nlos::k_rule_words) {
    const auto& cell = row[static_cast<std::size_t>(rule)];
    const auto& rates = cell.rates;
    if (!cell.judged()) continue;
    out[std::string{word}] = {{"los", rates.los},
                              {"los_right", rates.los_right},
                              {"nlos", rates.nlos},
                              {"nlos_right", rates.nlos_right},
                              {"los_rate", rates.los_rate()},
                              {"nlos_rate", rates.nlos_rate()}};
  }
  return out;
}

Ordered thresholds_json(const nlos::RuleSet& rules) {
  Ordered out = Ordered::object();
  if (rules.rss)
    out["rss"] = {{"at_zero_dbm", rules.rss->at_zero_dbm},
                  {"slope_dbm_per_m", rules.rss->slope_dbm_per_m},
                  {"weight", rules.weight[0]}};
  for (const auto& [word, rule] : nlos::k_rule_words) {
    const auto at = static_cast<std::size_t>(rule);
    if (const auto& t = rules.threshold[at])
      out[std::string{word}] = {
          {"threshold", t->threshold}, {"los_above", t->los_above}, {"weight", rules.weight[at]}};
  }
  return out;
}

}  // namespace

std::string rules_text(const std::vector<RuleReport>& reports) {
  std::string out =
      "Rules of chapter 5. printed: the dissertation's thresholds; fitted: fitted to the data set's other "
      "places.\nMED mean excess delay, RMSDS RMS delay spread, * beyond 6.5 m only, FP first-path "
      "difference; X "
      "nothing to look at.\n";
  return out + block(reports, true) + block(reports, false);
}

std::string rules_json(const std::vector<RuleReport>& reports) {
  Ordered sets = Ordered::array();
  for (const auto& r : reports)
    sets.push_back({{"data_set", r.data_set},
                    {"los_rows", r.los_rows},
                    {"nlos_rows", r.nlos_rows},
                    {"printed", rates_json(r.printed)},
                    {"fitted", rates_json(r.fitted)},
                    {"thresholds", thresholds_json(r.rules)}});
  return to_wire(Ordered{{"positive", "LOS"}, {"data_sets", sets}}, 2) + "\n";
}

}  // namespace anchord::api
