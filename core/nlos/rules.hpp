#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

/// The dissertation's plain rules (chapter 5): each looks at one feature; a weighted vote joins them.
namespace anchord::nlos {

/// RSS a line-of-sight link is expected to exceed at a distance (eq 5.1).
struct RssLine {
  double at_zero_dbm = -80.3977;      ///< eq 5.1
  double slope_dbm_per_m = -0.84708;  ///< eq 5.1

  double threshold_dbm(double range_m) const { return at_zero_dbm + slope_dbm_per_m * range_m; }
  /// eq 5.2: above the line is LOS, on it or below is NLOS.
  bool calls_los(double rss_dbm, double range_m) const { return rss_dbm > threshold_dbm(range_m); }
};

struct RssSample {
  double distance_m{};  ///< true distance where known, else as measured
  double rss_dbm{};
};

/// Per distance bin the RSS that `share` of the LOS samples exceed, then a least-squares line through those
/// (5.1). errors: too_few_observations below 2 bins of min_per_bin samples
struct RssFitOptions {
  double share = 0.90;
  double bin_m = 0.5;           ///< the campaign's own step
  std::size_t min_per_bin = 5;  ///< fewer give no 10 % quantile
};
Result<RssLine> fit_rss_line(std::span<const RssSample> los_samples, const RssFitOptions& options = {});

/// A threshold on one value.
struct ThresholdRule {
  double threshold{};
  bool los_above{};  ///< true: above is LOS; false: above is NLOS

  /// A value on the threshold is NLOS: the mistake that costs less.
  bool calls_los(double value) const { return los_above ? value > threshold : value < threshold; }
};

inline constexpr ThresholdRule k_range_sd_rule_m{0.050, false};  ///< 5.2: 50 mm
inline constexpr ThresholdRule k_rms_delay_rule{
    68.7, false};  ///< 5.3.3, CIR samples: 90 % of the NLOS records; squared 4721.9
inline constexpr ThresholdRule k_rms_delay_squared_rule{4430.0, false};  ///< 5.3.3: 95 %
inline constexpr ThresholdRule k_first_path_rule_db{6.0, false};         ///< 5.3.4: P_RX - P_FP

/// Threshold that keeps `share` of the NLOS values on its NLOS side (90 % in 5.3.3). errors:
/// too_few_observations when empty
Result<ThresholdRule> fit_threshold_for_nlos_share(std::span<const double> nlos_values, bool los_above,
                                                   double share = 0.90);

/// Threshold of the best balanced accuracy, for features the dissertation gives no figure for (kurtosis, mean
/// excess delay); the side is chosen by the data. errors: too_few_observations when a class is empty
Result<ThresholdRule> fit_threshold(std::span<const double> los_values, std::span<const double> nlos_values);

/// The maker's rough score of P_RX - P_FP: 1 below 6 dB, 0 above 10 dB, linear between.
double first_path_los_score(double rx_minus_fp_db);

/// One rule's voice in the weighted decision.
struct Vote {
  double p_nlos{};  ///< 0..1
  double weight{};  ///< >= 0; eq 5.8's W
};

/// p_NLOS = sum W p / sum W (eq 5.8). No value without any weight.
std::optional<double> weighted_p_nlos(std::span<const Vote> votes);

/// Weight of a rule from its balanced accuracy on training data: ln(a / (1 - a)), 0 for a coin; how eq 5.8 is
/// weighted here, since the dissertation leaves the weights open.
double vote_weight(double balanced_accuracy);

/// Hit rates of one rule on one data set: a cell of tables 5.2 and 5.3.
struct RuleRates {
  std::size_t los{}, los_right{}, nlos{}, nlos_right{};
  double los_rate() const { return los ? static_cast<double>(los_right) / static_cast<double>(los) : 0; }
  double nlos_rate() const { return nlos ? static_cast<double>(nlos_right) / static_cast<double>(nlos) : 0; }
  void count(bool is_los, bool called_los);
};

}  // namespace anchord::nlos
