#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Field -> names of columns (CSV) and keys (NDJSON) it goes by in the public sets; the first match wins. One
/// table for campaigns and labelled tables; capitals, blanks, underscores and brackets do not matter.
namespace anchord::api::columns {

using Names = std::vector<std::string_view>;

inline const Names k_range{"range_m",
                           "measured_range_m",
                           "range",
                           "measured_range",
                           "range_mm",
                           "measured_range_mm",
                           "range_cm",
                           "measured_range_cm",
                           "uwb_range",
                           "uwb_range_m",
                           "uwb_range_mm",
                           "uwb_range_cm",
                           "measured_distance",
                           "measured_distance_m",
                           "measured_dist_m",
                           "measured_distance_mm",
                           "measured_distance_cm"};
/// Measured where there is no other range, the truth beside one.
inline const Names k_distance{"distance_m", "distance", "distance_mm", "distance_cm"};
inline const Names k_truth{"true_range_m",
                           "true_range_2d_m",
                           "true_distance_m",
                           "rtk_range_m",
                           "truth_m",
                           "true_range",
                           "true_distance",
                           "ground_truth_m",
                           "ground_truth",
                           "truth",
                           "true_range_mm",
                           "true_distance_mm",
                           "ground_truth_mm",
                           "truth_mm",
                           "rtk_range_mm",
                           "true_range_cm",
                           "true_distance_cm",
                           "ground_truth_cm",
                           "truth_cm",
                           "actual_distance",
                           "actual_distance_m",
                           "actual_distance_mm",
                           "actual_distance_cm",
                           "real_distance_m",
                           "real_distance_mm",
                           "real_distance_cm",
                           "laser_m",
                           "laser_mm",
                           "laser_cm"};
/// Those whose names say what 0 and 1 mean come first.
inline const Names k_label{"nlos", "is_nlos", "los", "is_los", "label", "cls", "class"};
inline const Names k_rx{"rx_dbm", "rss_dbm", "rx_power_dbm", "rss", "rssi", "rssi_dbm", "rx_power"};
inline const Names k_fp{"fp_dbm", "first_path_dbm", "first_path_power", "fp_power_dbm", "fp_power"};
inline const Names k_f1{"fp_amp1", "firstPathAmp1"}, k_f2{"fp_amp2", "firstPathAmp2"},
    k_f3{"fp_amp3", "firstPathAmp3"};
inline const Names k_cir_power{"cir_pwr", "cir_power", "maxGrowthCIR"};
inline const Names k_count{"rxpacc", "rxPreamCount", "preamble_count"};
inline const Names k_std_noise{"std_noise", "stdNoise", "stdev_noise"}, k_max_noise{"max_noise", "maxNoise"};
inline const Names k_fp_index{"fp_index", "firstPath", "fp_idx"};
inline const Names k_height{"height_diff_m", "height_difference_m"};
inline const Names k_heading{"heading_deg"};
inline const Names k_truth_sd{"truth_sd_m", "truth_sigma_m", "truth_accuracy_m"};

/// Of campaigns: names of a setting, of its place and of what is measured of it.
inline const Names k_site_name{"site", "setting", "setup_id", "setup", "placement", "measurement_point"};
inline const Names k_environment{"environment", "env", "place", "room", "group"};
inline const Names k_site_height{"height_m", "height_diff_m", "height_difference_m"};
inline const Names k_material{"material"}, k_thickness{"thickness_m"};
inline const Names k_seconds{"t_s", "unix_s", "time_s"}, k_milliseconds{"t_ms", "timestamp_ms"},
    k_microseconds{"t_us"};
/// Beside a measured range these are the truth.
inline const Names k_distance_truth{"distance_m", "distance_mm", "distance_cm"};

/// "FP Power [dBm]" and "fp_power_dbm" are one name.
std::string bare_name(std::string_view name);
/// The name of these tables that a column or key of a campaign goes by; empty for one that is unknown.
std::string_view known_name(std::string_view name);
/// Where the first of the names that the header has stands: as it is spelled here, else alike.
std::optional<std::size_t> first_of(std::span<const std::string> header, const Names& names);
/// Metres of one unit of a column, by the end of its name; nothing where that is a unit of something else
/// ("range_ft", "tof_ns"). A name without a unit is metres.
std::optional<double> metres_per_unit(std::string_view name);
/// A length in the unit of its column, in metres: 5100 of "range_mm" is the number that 5.1 of "range_m" is.
double in_metres(double length, std::string_view name);

/// "CIR0 to CIR1015 (1016 columns)": numbered columns that follow one another are one entry.
std::vector<std::string> in_runs(std::span<const std::string> names);

/// A length and what it is measured against, of one row, in metres as the names have it.
struct Ratios {
  std::vector<double> values{};
  void add(double range_m, double truth_m) {
    if (range_m > 0 && truth_m > 0) values.push_back(range_m / truth_m);
  }
};
/// Empty, or why no unit can be believed: the median of range / truth is a hundred or a thousand, or the
/// inverse, within 20 %.
std::string unit_conflict(const Ratios& ratios, std::string_view range, std::string_view truth);

/// Empty, or that more than one measured range in twenty is no range of a radio in metres beside the truth.
std::string implausible_ranges(std::size_t implausible, std::size_t of);

}  // namespace anchord::api::columns
