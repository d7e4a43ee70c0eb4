#include "core/procedure/turn.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace anchord::procedure {
namespace {

constexpr double k_turn = 2 * std::numbers::pi, k_degree = std::numbers::pi / 180;
constexpr std::array k_lobes_rad{120 * k_degree, 250 * k_degree};  // Fig 8.4a
constexpr double k_lobe_width_rad =
    35 * k_degree;  // chosen: the lobes of the figure fall to half in about 40 degrees
constexpr int k_steps = 720;

double wrap(double angle) { return angle - k_turn * std::floor(angle / k_turn); }
double apart(double a, double b) {
  const double d = wrap(a - b);
  return std::min(d, k_turn - d);
}

}  // namespace

double turn_profile(double orientation_rad) {
  double out = 0;
  for (const double lobe : k_lobes_rad) {
    const double z = apart(orientation_rad, lobe) / k_lobe_width_rad;
    out += std::exp(-0.5 * z * z);
  }
  return out;
}

Result<Bearing> bearing_from_turn(std::span<const TurnSample> samples) {
  constexpr std::size_t k_min = 8;
  if (samples.size() < k_min) {
    return make_error(Errc::too_few_observations,
                      std::to_string(samples.size()) + " samples of a turn, need " + std::to_string(k_min));
  }
  std::vector<double> headings;
  double mean_dbm = 0;
  for (const auto& s : samples) {
    if (!std::isfinite(s.heading_rad) || !std::isfinite(s.rss_dbm)) {
      return make_error(Errc::invalid_argument, "a sample of the turn is not finite");
    }
    headings.push_back(wrap(s.heading_rad));
    mean_dbm += s.rss_dbm / static_cast<double>(samples.size());
  }
  std::sort(headings.begin(), headings.end());
  double gap = headings.front() + k_turn - headings.back();
  for (std::size_t i = 1; i < headings.size(); ++i) gap = std::max(gap, headings[i] - headings[i - 1]);
  if (gap > std::numbers::pi / 2) {
    return make_error(
        Errc::weak_geometry,
        "the turn leaves " + std::to_string(static_cast<int>(gap / k_degree)) + " degrees unseen");
  }
  double power = 0;
  for (const auto& s : samples) power += (s.rss_dbm - mean_dbm) * (s.rss_dbm - mean_dbm);
  if (std::sqrt(power / static_cast<double>(samples.size())) < 0.1) {
    return make_error(Errc::weak_geometry, "RSS is the same all round: no lobe to find");
  }

  std::vector<double> score(k_steps);
  for (int k = 0; k < k_steps; ++k) {
    const double bearing = k_turn * k / k_steps;
    double mean = 0, dot = 0, norm = 0;
    for (const auto& s : samples)
      mean += turn_profile(s.heading_rad - bearing) / static_cast<double>(samples.size());
    for (const auto& s : samples) {
      const double t = turn_profile(s.heading_rad - bearing) - mean;
      dot += t * (s.rss_dbm - mean_dbm);
      norm += t * t;
    }
    score[static_cast<std::size_t>(k)] = norm > 0 ? dot / std::sqrt(norm * power) : 0;
  }
  const auto best = std::max_element(score.begin(), score.end()) - score.begin();
  const double bearing = k_turn * static_cast<double>(best) / k_steps;
  double elsewhere = 0;
  for (int k = 0; k < k_steps; ++k) {
    if (apart(k_turn * k / k_steps, bearing) > 60 * k_degree) {
      elsewhere = std::max(elsewhere, score[static_cast<std::size_t>(k)]);
    }
  }
  const double top = score[static_cast<std::size_t>(best)];
  const double confidence = std::clamp(top - elsewhere, 0.0, 1.0) * std::clamp(top, 0.0, 1.0);
  return Bearing{bearing, 20 * k_degree / std::max(0.2, std::min(1.0, 2 * confidence)), confidence};
}

}  // namespace anchord::procedure
