#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// Accuracy of a laser meter's truth: 4 mm in sight, 12 mm where the line is laid round an obstacle (eq 4.4).
inline constexpr double k_truth_sd_los_m = 0.004;
inline constexpr double k_truth_sd_nlos_m = 0.012;

/// One arrangement of the two devices, with what was measured by hand (4.2).
struct CampaignSite {
  std::string name{};         ///< empty: told from the others by its values
  std::string environment{};  ///< hall, office: what no split may divide
  std::string material{};     ///< of the obstacle
  std::optional<double> distance_m{};
  std::optional<double> heading_deg{};
  std::optional<double> height_m{};  ///< height difference of the antennas
  std::optional<double> thickness_m{};
  std::optional<bool> los{};
  std::optional<double> truth_sd_m{};  ///< absent: that of eq 4.4 for the class

  bool operator==(const CampaignSite&) const = default;
};

/// One ranging of a campaign, as received.
struct CampaignMeasurement {
  std::size_t site{};  ///< index into Campaign::sites
  std::size_t line{};  ///< of the source, from 1
  std::optional<double> t_s{};
  double range_m{};
  std::optional<double> rx_dbm{}, fp_dbm{};
  std::optional<double> fp_amp1{}, fp_amp2{}, fp_amp3{};
  std::optional<double> cir_power{}, preamble_count{}, std_noise{}, max_noise{}, fp_index{};
  std::optional<Cir> cir{};  ///< of NDJSON lines only
};

struct Campaign {
  std::vector<CampaignSite> sites{};
  std::vector<CampaignMeasurement> measurements{};
};

}  // namespace anchord
