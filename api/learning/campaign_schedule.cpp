#include "api/learning/campaign_schedule.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::api {
namespace {

/// Nearest of `n` steps, at most half a step beyond either end.
std::optional<std::size_t> nearest(double value, double first, double step, std::size_t n) {
  if (!std::isfinite(value)) return std::nullopt;
  const double at = std::round((value - first) / step);
  if (at < 0 || at > static_cast<double>(n - 1)) return std::nullopt;
  return static_cast<std::size_t>(at);
}

}  // namespace

std::optional<std::size_t> CampaignGrid::cell_of(const GroundTruth& truth) {
  if (!truth.distance_m || !truth.height_difference_m || !truth.heading_deg) return std::nullopt;
  const auto distance = nearest(*truth.distance_m, distance_m(0), 0.5, k_distances);
  const auto height = nearest(std::abs(*truth.height_difference_m), height_m(0), 0.5, k_heights);
  double turn_deg = std::fmod(*truth.heading_deg, 360.0);
  if (turn_deg < 0) turn_deg += 360.0;
  const auto heading = nearest(turn_deg, 0, 22.5, k_headings + 1);  // 360 is 0 again
  if (!distance || !height || !heading) return std::nullopt;
  return (*distance * k_heights + *height) * k_headings + *heading % k_headings;
}

std::size_t CampaignProgress::n_measured(std::size_t wanted) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(n_samples, [&](std::size_t n) { return n >= wanted; }));
}

CampaignProgress campaign_progress(std::span<const CampaignStore::Setting> settings,
                                   const ScheduleFilter& filter) {
  CampaignProgress out;
  for (const auto& setting : settings) {
    if (filter.environment && setting.truth.environment != *filter.environment) continue;
    if (filter.los && setting.truth.los != filter.los) continue;
    if (const auto cell = CampaignGrid::cell_of(setting.truth))
      out.n_samples[*cell] += setting.n_samples;
    else
      out.n_off_grid += setting.n_samples;
  }
  return out;
}

}  // namespace anchord::api
