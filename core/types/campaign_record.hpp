#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// A series of measurements at places whose truth was measured by other means.
struct CampaignRecord {
  CampaignId id{};
  std::string name;  ///< unique
  std::string radio, note;
  std::optional<double> truth_sigma_m{};  ///< of the reference the distances were measured with
  UtcTime created{};
  std::uint64_t version{1};
};

/// What is true of every measurement taken at one setting of the devices (chapter 4).
struct GroundTruth {
  std::string setting;      ///< unique in its campaign; made of the other fields where the source gives none
  std::string environment;  ///< room, hall, street: what no split divides
  std::optional<double> distance_m{};
  std::optional<bool> los{};
  std::optional<double> heading_deg{}, height_difference_m{};
  std::string material;  ///< of the obstacle
  std::optional<double> thickness_m{};
  std::optional<double> truth_sigma_m{};  ///< where it differs from the campaign's
};

/// One ranging at a setting, with whatever its radio told. Registers as the DW1000 gives them.
struct CampaignSample {
  std::optional<UtcTime> time{};
  std::optional<std::uint64_t> seq{};
  double range_m{};
  std::optional<double> rx_dbm{}, fp_dbm{};
  std::optional<double> fp_amp1{}, fp_amp2{}, fp_amp3{};
  std::optional<double> cir_power{}, preamble_count{};
  std::optional<double> std_noise{}, max_noise{};
  std::optional<double> fp_index{};
  std::optional<Cir> cir{};
};

}  // namespace anchord
