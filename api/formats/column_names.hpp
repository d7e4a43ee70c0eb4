#pragma once

#include <string_view>
#include <vector>

/// Field -> names of columns (CSV) and keys (NDJSON) it goes by in the public sets; the first match wins.
namespace anchord::api::columns {

using Names = std::vector<std::string_view>;

inline const Names k_range{
    "range_m",        "distance_m",           "measured_range_m",  "range",       "distance",
    "measured_range", "measured_distance_m",  "measured_distance", "range_mm",    "measured_range_mm",
    "distance_mm",    "measured_distance_mm", "uwb_range",         "uwb_range_m", "range_cm",
    "distance_cm"};
inline const Names k_truth{"true_range_m",    "true_range_2d_m", "true_distance_m", "rtk_range_m",
                           "truth_m",         "true_range",      "true_distance",   "ground_truth_m",
                           "ground_truth",    "truth",           "true_range_mm",   "true_distance_mm",
                           "ground_truth_mm", "true_range_cm",   "actual_distance", "actual_distance_m",
                           "real_distance_m", "laser_m"};
inline const Names k_label{"nlos", "is_nlos", "los", "is_los", "label", "cls", "class"};
inline const Names k_rx{"rx_dbm", "rss_dbm", "rx_power_dbm", "rss", "rssi", "rssi_dbm", "rx_power"};
inline const Names k_fp{"fp_dbm", "first_path_dbm", "first_path_power", "fp_power_dbm", "fp_power"};
inline const Names k_f1{"fp_amp1", "firstPathAmp1"}, k_f2{"fp_amp2", "firstPathAmp2"},
    k_f3{"fp_amp3", "firstPathAmp3"};
inline const Names k_cir_power{"cir_pwr", "cir_power", "maxGrowthCIR"};
inline const Names k_count{"rxpacc", "rxPreamCount", "preamble_count"};
inline const Names k_std_noise{"std_noise", "stdNoise"}, k_max_noise{"max_noise", "maxNoise"};
inline const Names k_fp_index{"fp_index", "firstPath", "fp_idx"};
inline const Names k_height{"height_diff_m", "height_difference_m"};
inline const Names k_heading{"heading_deg"};
}  // namespace anchord::api::columns
