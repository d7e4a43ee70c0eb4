#include "core/nlos/rules.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace anchord::nlos {
namespace {

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  const double at = q * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const auto high = std::min(low + 1, values.size() - 1);
  return values[low] + (at - static_cast<double>(low)) * (values[high] - values[low]);
}

}  // namespace

Result<RssLine> fit_rss_line(std::span<const RssSample> los_samples, const RssFitOptions& options) {
  std::map<long, std::vector<RssSample>> bins;
  for (const auto& sample : los_samples) {
    if (!std::isfinite(sample.distance_m) || !std::isfinite(sample.rss_dbm) || sample.distance_m <= 0 ||
        sample.distance_m > 1e4)
      continue;
    bins[std::lround(sample.distance_m / options.bin_m)].push_back(sample);
  }
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (const auto& [key, samples] : bins) {
    if (samples.size() < options.min_per_bin) continue;
    std::vector<double> rss;
    double x = 0;
    for (const auto& sample : samples) {
      rss.push_back(sample.rss_dbm);
      x += sample.distance_m;
    }
    x /= static_cast<double>(samples.size());
    const double y = quantile(std::move(rss), 1 - options.share);
    n += 1;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  const double det = n * sxx - sx * sx;
  if (n < 2 || !(det > 0))
    return make_error(Errc::too_few_observations,
                      "RSS line needs two distances with enough LOS samples each, got " +
                          std::to_string(static_cast<int>(n)));
  const double slope = (n * sxy - sx * sy) / det;
  return RssLine{(sy - slope * sx) / n, slope};
}

Result<ThresholdRule> fit_threshold_for_nlos_share(std::span<const double> nlos_values, bool los_above,
                                                   double share) {
  if (nlos_values.empty())
    return make_error(Errc::too_few_observations, "a threshold needs NLOS values, got none");
  return ThresholdRule{quantile({nlos_values.begin(), nlos_values.end()}, los_above ? share : 1 - share),
                       los_above};
}

Result<ThresholdRule> fit_threshold(std::span<const double> los_values, std::span<const double> nlos_values) {
  if (los_values.empty() || nlos_values.empty())
    return make_error(Errc::too_few_observations, "a threshold needs values of both classes");
  std::vector<std::pair<double, bool>> all;  // value, is LOS
  for (const double v : los_values) all.emplace_back(v, true);
  for (const double v : nlos_values) all.emplace_back(v, false);
  std::sort(all.begin(), all.end());
  const auto n_los = static_cast<double>(los_values.size()), n_nlos = static_cast<double>(nlos_values.size());
  double los_below = 0, nlos_below = 0, best = -1;
  ThresholdRule rule{all.front().first, true};
  for (std::size_t i = 0; i + 1 < all.size(); ++i) {
    (all[i].second ? los_below : nlos_below) += 1;
    if (all[i].first == all[i + 1].first) continue;
    const double below_is_nlos = 0.5 * ((n_los - los_below) / n_los + nlos_below / n_nlos);
    const double middle = 0.5 * (all[i].first + all[i + 1].first);
    if (below_is_nlos > best) {
      best = below_is_nlos;
      rule = {middle, true};
    }
    if (1 - below_is_nlos > best) {
      best = 1 - below_is_nlos;
      rule = {middle, false};
    }
  }
  return rule;
}

double first_path_los_score(double rx_minus_fp_db) { return std::clamp((10 - rx_minus_fp_db) / 4, 0.0, 1.0); }

std::optional<double> weighted_p_nlos(std::span<const Vote> votes) {
  double sum = 0, weights = 0;
  for (const auto& vote : votes) {
    sum += vote.weight * vote.p_nlos;
    weights += vote.weight;
  }
  if (!(weights > 0)) return std::nullopt;
  return sum / weights;
}

double vote_weight(double balanced_accuracy) {
  const double a = std::clamp(balanced_accuracy, 0.5, 0.99);
  return std::log(a / (1 - a));
}

void RuleRates::count(bool is_los, bool called_los) {
  if (is_los) {
    ++los;
    los_right += called_los ? 1 : 0;
  } else {
    ++nlos;
    nlos_right += called_los ? 0 : 1;
  }
}

}  // namespace anchord::nlos
