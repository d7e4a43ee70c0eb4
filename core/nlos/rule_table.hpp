#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/nlos/rules.hpp"

/// Every rule of chapter 5 fitted to labelled rangings and judged on others: tables 5.1 to 5.3 for any data.
namespace anchord::nlos {

enum class Rule : std::uint8_t {
  rss,                ///< 5.1: above the line is LOS
  kurtosis,           ///< 5.3.1
  mean_excess_delay,  ///< 5.3.2
  rms_delay,          ///< 5.3.3, over the whole record
  rms_delay_far,      ///< 5.3.3 beyond 6.5 m only (RMSDS* of table 5.2)
  rms_delay_95,       ///< 5.3.3 with the threshold that 95 % of NLOS exceed
  range_sd,           ///< 5.2: sd of repeated ranges
  first_path,         ///< 5.3.4: P_RX - P_FP
  weighted,           ///< 5.8: all of them
};
inline constexpr auto k_rule_words = enum_table<Rule>({{"rss", Rule::rss},
                                                       {"kurtosis", Rule::kurtosis},
                                                       {"mean_excess_delay", Rule::mean_excess_delay},
                                                       {"rms_delay", Rule::rms_delay},
                                                       {"rms_delay_far", Rule::rms_delay_far},
                                                       {"rms_delay_95", Rule::rms_delay_95},
                                                       {"range_sd", Rule::range_sd},
                                                       {"first_path", Rule::first_path},
                                                       {"weighted", Rule::weighted}});
inline constexpr std::size_t k_rule_count = k_rule_words.size();
inline constexpr double k_far_m = 6.5;

/// What the rules look at; a sample may lack some.
struct RuleSample {
  bool los{};
  std::optional<double> distance_m{};  ///< true distance where known (as 5.1 does), else as measured
  std::optional<double> rss_dbm{};
  std::optional<double> range_sd_m{};
  std::optional<double> kurtosis{};
  std::optional<double> mean_excess_delay_ns{};
  std::optional<double> rms_delay_spread_ns{};  ///< over the whole record; a window cannot reach 68.7 taps
  std::optional<double> rx_minus_fp_db{};
};

/// Thresholds of every rule that has one, and the weights of the vote.
struct RuleSet {
  std::optional<RssLine> rss{};
  std::array<std::optional<ThresholdRule>, k_rule_count> threshold{};  ///< not for rss and weighted
  std::array<double, k_rule_count> weight{};                           ///< eq 5.8's W; 0: no voice

  /// No value where the rule has no threshold or the sample not what it looks at. The vote calls LOS below
  /// p_NLOS 0.5.
  std::optional<bool> calls_los(Rule rule, const RuleSample& sample) const;
  std::optional<double> p_nlos(const RuleSample& sample) const;  ///< eq 5.8
};

/// The thresholds the dissertation prints: line 5.1, 50 mm, 68.7 taps (and 4430 squared), 6 dB; kurtosis and
/// mean excess delay have none. Every voice weighs the same, since the weights are left open (5.4).
RuleSet printed_rules();

/// The line that 90 % of LOS exceed (5.1); the RMSDS threshold with 90 % of NLOS on its side (5.3.3); the
/// others at their best balanced accuracy. Weights: ln odds of each rule's balanced accuracy on these
/// samples. A rule whose values are lacking, or show only one class, is left out.
RuleSet fit_rules(std::span<const RuleSample> samples);

/// One rule on one data set.
struct RuleCell {
  RuleRates rates{};
  bool judged() const { return rates.los + rates.nlos > 0; }
};
using RuleRow = std::array<RuleCell, k_rule_count>;

/// Hit rates of one set of rules.
RuleRow evaluate_rules(const RuleSet& rules, std::span<const RuleSample> samples);

/// Hit rates where each sample is judged by rules fitted to the other folds only.
/// fold  of each sample, 0 .. k-1: whole places
RuleRow evaluate_fitted_rules(std::span<const RuleSample> samples, std::span<const std::size_t> fold);

}  // namespace anchord::nlos
