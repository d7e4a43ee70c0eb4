#include "core/nlos/rule_table.hpp"

#include <algorithm>
#include <cmath>

#include "core/nlos/cir.hpp"

namespace anchord::nlos {
namespace {

std::size_t at(Rule rule) { return static_cast<std::size_t>(rule); }

// The one value a threshold rule looks at.
std::optional<double> value_of(Rule rule, const RuleSample& s) {
  switch (rule) {
    case Rule::kurtosis:
      return s.kurtosis;
    case Rule::mean_excess_delay:
      return s.mean_excess_delay_ns;
    case Rule::rms_delay:
    case Rule::rms_delay_95:
      return s.rms_delay_spread_ns;
    case Rule::rms_delay_far:
      return s.distance_m && *s.distance_m > k_far_m ? s.rms_delay_spread_ns : std::nullopt;
    case Rule::range_sd:
      return s.range_sd_m;
    case Rule::first_path:
      return s.rx_minus_fp_db;
    case Rule::rss:
    case Rule::weighted:
      break;
  }
  return std::nullopt;
}

constexpr std::array k_threshold_rules{Rule::kurtosis,      Rule::mean_excess_delay, Rule::rms_delay,
                                       Rule::rms_delay_far, Rule::rms_delay_95,      Rule::range_sd,
                                       Rule::first_path};
// The variants look at what rms_delay looks at: they have a column, but no second voice.
constexpr std::array k_voices{Rule::rss,       Rule::kurtosis, Rule::mean_excess_delay,
                              Rule::rms_delay, Rule::range_sd, Rule::first_path};

}  // namespace

std::optional<bool> RuleSet::calls_los(Rule rule, const RuleSample& s) const {
  if (rule == Rule::weighted) {
    const auto p = p_nlos(s);
    return p ? std::optional{*p < 0.5} : std::nullopt;
  }
  if (rule == Rule::rss) {
    if (!rss || !s.rss_dbm || !s.distance_m) return std::nullopt;
    return rss->calls_los(*s.rss_dbm, *s.distance_m);
  }
  const auto value = value_of(rule, s);
  if (!value || !threshold[at(rule)]) return std::nullopt;
  return threshold[at(rule)]->calls_los(*value);
}

std::optional<double> RuleSet::p_nlos(const RuleSample& s) const {
  std::array<Vote, k_voices.size()> votes{};
  std::size_t n = 0;
  for (const Rule rule : k_voices) {
    if (!(weight[at(rule)] > 0)) continue;
    if (const auto los = calls_los(rule, s)) votes[n++] = {*los ? 0.0 : 1.0, weight[at(rule)]};
  }
  return weighted_p_nlos({votes.data(), n});
}

RuleSet printed_rules() {
  RuleSet out;
  out.rss = RssLine{};
  const double tap_ns = CirOptions{}.tap_ns;
  const ThresholdRule rms{k_rms_delay_rule.threshold * tap_ns, k_rms_delay_rule.los_above};
  out.threshold[at(Rule::rms_delay)] = rms;
  out.threshold[at(Rule::rms_delay_far)] = rms;
  out.threshold[at(Rule::rms_delay_95)] = {std::sqrt(k_rms_delay_squared_rule.threshold) * tap_ns,
                                           k_rms_delay_squared_rule.los_above};
  out.threshold[at(Rule::range_sd)] = k_range_sd_rule_m;
  out.threshold[at(Rule::first_path)] = k_first_path_rule_db;
  for (const Rule rule : {Rule::rss, Rule::rms_delay, Rule::range_sd, Rule::first_path})
    out.weight[at(rule)] = 1;
  return out;
}

RuleSet fit_rules(std::span<const RuleSample> samples) {
  RuleSet out;
  std::vector<RssSample> levels;
  for (const auto& s : samples)
    if (s.los && s.distance_m && s.rss_dbm) levels.push_back({*s.distance_m, *s.rss_dbm});
  if (const auto line = fit_rss_line(levels)) out.rss = line.value();
  for (const Rule rule : k_threshold_rules) {
    std::vector<double> los, nlos;
    for (const auto& s : samples)
      if (const auto value = value_of(rule, s)) (s.los ? los : nlos).push_back(*value);
    if (los.empty() || nlos.empty()) continue;
    const bool by_share =
        rule == Rule::rms_delay || rule == Rule::rms_delay_far || rule == Rule::rms_delay_95;
    const double share = rule == Rule::rms_delay_95 ? 0.95 : 0.90;
    const auto fitted =
        by_share ? fit_threshold_for_nlos_share(nlos, false, share) : fit_threshold(los, nlos);
    if (fitted) out.threshold[at(rule)] = fitted.value();
  }
  const auto row = evaluate_rules(out, samples);
  for (const Rule rule : k_voices) {
    const auto& rates = row[at(rule)].rates;
    if (rates.los > 0 && rates.nlos > 0)
      out.weight[at(rule)] = vote_weight(0.5 * (rates.los_rate() + rates.nlos_rate()));
  }
  return out;
}

RuleRow evaluate_rules(const RuleSet& rules, std::span<const RuleSample> samples) {
  RuleRow row{};
  for (const auto& s : samples)
    for (const auto& [word, rule] : k_rule_words)
      if (const auto los = rules.calls_los(rule, s)) row[at(rule)].rates.count(s.los, *los);
  return row;
}

RuleRow evaluate_fitted_rules(std::span<const RuleSample> samples, std::span<const std::size_t> fold) {
  RuleRow row{};
  const std::size_t folds = fold.empty() ? 0 : *std::max_element(fold.begin(), fold.end()) + 1;
  for (std::size_t k = 0; k < folds; ++k) {
    std::vector<RuleSample> train, test;
    for (std::size_t i = 0; i < samples.size(); ++i) (fold[i] == k ? test : train).push_back(samples[i]);
    const auto part = evaluate_rules(fit_rules(train), test);
    for (std::size_t r = 0; r < k_rule_count; ++r) {
      row[r].rates.los += part[r].rates.los;
      row[r].rates.los_right += part[r].rates.los_right;
      row[r].rates.nlos += part[r].rates.nlos;
      row[r].rates.nlos_right += part[r].rates.nlos_right;
    }
  }
  return row;
}

}  // namespace anchord::nlos
