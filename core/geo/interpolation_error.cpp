#include "core/geo/interpolation_error.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/median.hpp"
#include "core/geo/tag_track.hpp"

namespace anchord {
namespace {

constexpr double k_acceleration_mps2 = 1.0;
constexpr double k_longest_s = 64.0;
constexpr std::size_t k_most_triples = 1000;

double median_interval_s(std::span<const TrackPose> poses) {
  std::vector<double> interval_s;
  for (std::size_t i = 1; i < poses.size(); ++i) interval_s.push_back(poses[i].t_s - poses[i - 1].t_s);
  return upper_median(interval_s);
}

}  // namespace

InterpolationError::InterpolationError(std::span<const TrackPose> poses) {
  const double step_s = poses.size() >= 3 ? median_interval_s(poses) : 0.0;
  for (std::size_t apart = 1; step_s > 0 && 2 * apart < poses.size(); apart *= 2) {
    const double expected_s = 2.0 * static_cast<double>(apart) * step_s;
    if (expected_s > k_longest_s) break;
    const std::size_t stride = std::max<std::size_t>(1, (poses.size() - 2 * apart) / k_most_triples);
    double sum_s = 0;
    std::vector<double> missed_m2;
    for (std::size_t i = 0; i + 2 * apart < poses.size(); i += stride) {
      const TrackPose &from = poses[i], &left_out = poses[i + apart], &to = poses[i + 2 * apart];
      const double interval_s = to.t_s - from.t_s;
      const double share = (left_out.t_s - from.t_s) / interval_s;
      // A pause in the track would count as a span it is not; near an end of the interval little is missed.
      if (interval_s > 1.5 * expected_s || share < 0.25 || share > 0.75) continue;
      const Eigen::Vector3d line_m = (1.0 - share) * from.position_m + share * to.position_m;
      const double midway = 4.0 * share * (1.0 - share);
      missed_m2.push_back((left_out.position_m - line_m).squaredNorm() / (3.0 * midway * midway));
      sum_s += interval_s;
    }
    if (missed_m2.size() < k_least) continue;
    const double interval_s = sum_s / static_cast<double>(missed_m2.size());
    // The worst of a hundred are left out: a jump of the base is no way that was flown.
    const auto kept = static_cast<std::ptrdiff_t>(missed_m2.size() - missed_m2.size() / 100);
    std::ranges::nth_element(missed_m2, missed_m2.begin() + kept - 1);
    const double sum_m2 = std::accumulate(missed_m2.begin(), missed_m2.begin() + kept, 0.0);
    spans_.push_back({interval_s, std::sqrt(sum_m2 / static_cast<double>(kept))});
  }
  if (spans_.empty()) spans_.push_back({1.0, k_acceleration_mps2 / 8.0});
}

double InterpolationError::sigma_m(double interval_s, double share) const {
  if (!(interval_s > 0)) return 0;
  const double part = 4.0 * std::clamp(share, 0.0, 1.0) * (1.0 - std::clamp(share, 0.0, 1.0));
  if (!(part > 0)) return 0;
  // The pair of spans round the interval, or the outermost one.
  std::size_t i = 0;
  while (i + 2 < spans_.size() && spans_[i + 1].interval_s < interval_s) ++i;
  double power = 2.0;
  if (spans_.size() > 1) {
    const Span &a = spans_[i], &b = spans_[i + 1];
    power = std::clamp(std::log(std::max(b.midway_m, 1e-6) / std::max(a.midway_m, 1e-6)) /
                           std::log(b.interval_s / a.interval_s),
                       1.0, 2.0);
  }
  return part * spans_[i].midway_m * std::pow(interval_s / spans_[i].interval_s, power);
}

}  // namespace anchord
