#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/ports/learning_store.hpp"

namespace anchord::api {

/// The campaign of the dissertation (4.2) as a plan: 17 distances x 5 heights x 16 orientations.
struct CampaignGrid {
  static constexpr std::size_t k_distances = 17, k_heights = 5, k_headings = 16;
  static constexpr std::size_t k_cells = k_distances * k_heights * k_headings;
  static double distance_m(std::size_t i) { return 2.0 + 0.5 * static_cast<double>(i); }
  static double height_m(std::size_t i) { return 0.5 * static_cast<double>(i); }
  static double heading_deg(std::size_t i) { return 22.5 * static_cast<double>(i); }
  /// The cell a setting was taken at: nearest in each, at most half a step off; heights count either way.
  /// Nothing where it states too little or is elsewhere.
  static std::optional<std::size_t> cell_of(const GroundTruth& truth);
};

/// Which settings count.
struct ScheduleFilter {
  std::optional<std::string> environment{};
  std::optional<bool> los{};
};

/// How much of it a campaign has.
struct CampaignProgress {
  std::array<std::size_t, CampaignGrid::k_cells>
      n_samples{};           ///< distance by distance, height by height, heading
  std::size_t n_off_grid{};  ///< samples at other places, or of unstated ones
  std::size_t n_measured(std::size_t wanted) const;
};
CampaignProgress campaign_progress(std::span<const CampaignStore::Setting> settings,
                                   const ScheduleFilter& filter = {});

}  // namespace anchord::api
