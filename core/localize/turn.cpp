#include "core/localize/turn.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/base/angle.hpp"

namespace anchord {
namespace {

constexpr double k_turn = 2 * std::numbers::pi;
constexpr std::array k_lobes_rad{120 * k_degree, 250 * k_degree};  // Fig 8.4a
constexpr double k_lobe_width_rad =
    35 * k_degree;              // chosen: the lobes of the figure fall to half in about 40 degrees
constexpr int k_tenths = 3600;  ///< of a degree in a turn
constexpr int k_coarse_tenths = 20,
              k_tenths_step = 5;  ///< a lobe is wide: first each 2 degrees, then each half

double wrap(double angle) { return angle - k_turn * std::floor(angle / k_turn); }
double apart(double a, double b) {
  const double d = wrap(a - b);
  return std::min(d, k_turn - d);
}

/// By tenths of a degree: the exponentials are most of the work of a fit, and a flight may have 500 anchors.
/// Between its entries a straight line is 1e-6 off.
const std::array<double, k_tenths + 1>& profile_table() {
  static const auto k_table = [] {
    std::array<double, k_tenths + 1> out{};
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] = turn_profile(k_turn * static_cast<double>(i) / k_tenths);
    return out;
  }();
  return k_table;
}

/// Correlation of the samples' RSS with the profile, of any bearing.
class Match {
 public:
  Match(std::span<const TurnSample> samples, double mean_dbm, double power) : power_(power) {
    for (const auto& s : samples) {
      const double tenths = wrap(s.heading_rad) / k_turn * k_tenths;
      const int whole = std::min(static_cast<int>(tenths), k_tenths - 1);
      samples_.push_back({whole, tenths - whole, s.rss_dbm - mean_dbm});
    }
  }
  double operator()(int bearing_tenths) const {
    const auto& table = profile_table();
    double sum = 0, squares = 0, dot = 0;
    for (const auto& s : samples_) {
      const auto i = static_cast<std::size_t>((s.heading_tenths - bearing_tenths + k_tenths) % k_tenths);
      const double t = table[i] + s.fraction * (table[i + 1] - table[i]);
      sum += t;
      squares += t * t;
      dot += t * s.rss_db;
    }
    const double norm = squares - sum * sum / static_cast<double>(samples_.size());
    return norm > 0 ? dot / std::sqrt(norm * power_) : 0;
  }

 private:
  struct Sample {
    int heading_tenths;
    double fraction, rss_db;  ///< over the mean
  };
  std::vector<Sample> samples_;
  double power_;
};

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
        "the turn leaves " + std::to_string(static_cast<int>(gap / k_degree)) + " degrees without a sample");
  }
  double power = 0;
  for (const auto& s : samples) power += (s.rss_dbm - mean_dbm) * (s.rss_dbm - mean_dbm);
  if (std::sqrt(power / static_cast<double>(samples.size())) < 0.1) {
    return make_error(Errc::weak_geometry, "RSS is the same in all directions: there is no lobe to find");
  }

  const Match match(samples, mean_dbm, power);
  std::array<double, k_tenths / k_coarse_tenths> score{};
  for (std::size_t k = 0; k < score.size(); ++k) score[k] = match(static_cast<int>(k) * k_coarse_tenths);
  const auto coarse = static_cast<int>(std::ranges::max_element(score) - score.begin()) * k_coarse_tenths;
  int best = coarse;
  double top = match(coarse);
  for (int off = -k_coarse_tenths + k_tenths_step; off < k_coarse_tenths; off += k_tenths_step) {
    const int tenths = (coarse + off + k_tenths) % k_tenths;
    if (const double here = match(tenths); here > top) {
      top = here;
      best = tenths;
    }
  }
  const double bearing = k_turn * best / k_tenths;
  double elsewhere = 0;
  for (std::size_t k = 0; k < score.size(); ++k) {
    if (apart(k_turn * static_cast<double>(k) / static_cast<double>(score.size()), bearing) > 60 * k_degree)
      elsewhere = std::max(elsewhere, score[k]);
  }
  const double confidence = std::clamp(top - elsewhere, 0.0, 1.0) * std::clamp(top, 0.0, 1.0);
  return Bearing{bearing, 20 * k_degree / std::max(0.2, std::min(1.0, 2 * confidence)), confidence};
}

}  // namespace anchord
