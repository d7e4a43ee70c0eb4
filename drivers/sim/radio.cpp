#include "drivers/sim/radio.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/base/angle.hpp"

namespace anchord::sim {
namespace {

/// Smallest angle between two directions, 0..pi.
double apart_rad(double a, double b) { return std::abs(std::remainder(a - b, 2.0 * std::numbers::pi)); }

/// -61, -63, ... -95 dBm; millimetres. dw1000-diagnostics.md section 4.
constexpr std::array k_level_bias_mm{-110.0, -105.0, -100.0, -93.0, -82.0, -69.0, -51.0, -27.0, 0.0,
                                     21.0,   35.0,   42.0,   49.0,  62.0,  71.0,  76.0,  81.0,  86.0};

}  // namespace

double friis_dbm(double transmit_dbm, double carrier_hz, double distance_m) {
  constexpr double k_light_mps = 299'792'458.0;
  const double wavelength_m = k_light_mps / carrier_hz;
  return transmit_dbm +
         20.0 * std::log10(wavelength_m / (4.0 * std::numbers::pi * std::max(distance_m, 0.01)));
}

double turn_gain_db(double orientation_rad, double depth_db) {
  // Width: the two lobes of Fig 8.4 are told apart, with a shallow saddle between them at 185 degrees.
  constexpr double k_width_rad = 40.0 * k_degree;
  double best = 0;
  for (const double lobe_rad : {120.0 * k_degree, 250.0 * k_degree}) {
    const double z = apart_rad(orientation_rad, lobe_rad) / k_width_rad;
    best = std::max(best, std::exp(-0.5 * z * z));
  }
  return -depth_db * (1.0 - best);
}

double dipole_gain_db(double elevation_rad) {
  const double cosine = std::cos(elevation_rad);
  if (std::abs(cosine) < 1e-6) return -20.0;
  const double field = std::cos(std::numbers::pi / 2 * std::sin(elevation_rad)) / cosine;
  return std::max(-20.0, 20.0 * std::log10(std::max(std::abs(field), 1e-6)));
}

double level_bias_m(double received_dbm) {
  const double row =
      std::clamp((-61.0 - received_dbm) / 2.0, 0.0, static_cast<double>(k_level_bias_mm.size() - 1));
  const auto below = std::min(static_cast<std::size_t>(row), k_level_bias_mm.size() - 2);
  const double share = row - static_cast<double>(below);
  return 1e-3 * ((1 - share) * k_level_bias_mm[below] + share * k_level_bias_mm[below + 1]);
}

double mean_level_dbm(const RadioOptions& options, const Terminal& from, const Terminal& to,
                      const Obstruction& wall) {
  const Eigen::Vector3d step_m = to.enu_m - from.enu_m;
  double level_dbm = friis_dbm(options.transmit_dbm, options.carrier_hz, step_m.norm()) - wall.loss_db;
  if (options.turn_lobe_db > 0) {
    const double bearing_rad = std::atan2(step_m.x(), step_m.y());
    if (from.heading_rad) level_dbm += turn_gain_db(*from.heading_rad - bearing_rad, options.turn_lobe_db);
    if (to.heading_rad) {
      level_dbm += turn_gain_db(*to.heading_rad - bearing_rad - std::numbers::pi, options.turn_lobe_db);
    }
  }
  if (options.height_lobe) level_dbm += 2 * dipole_gain_db(std::atan2(step_m.z(), step_m.head<2>().norm()));
  return level_dbm;
}

std::optional<Exchange> simulate_exchange(const World& world, const RadioOptions& options,
                                          const Terminal& from, const Terminal& to, Random& random) {
  const double truth_m = (from.enu_m - to.enu_m).norm();
  const Obstruction wall = obstruction_between(world, from.enu_m, to.enu_m);
  const double noise_m = options.range_sigma_m * random.normal();
  const double spread_m = 0.25 * wall.excess_m * random.normal();
  const double tail_m = random.exponential(0.15 * wall.excess_m);
  const double rss_dbm = mean_level_dbm(options, from, to, wall) + options.rss_sigma_db * random.normal();
  const bool heard = random.chance(1.0 / (1.0 + std::exp(options.sensitivity_dbm - rss_dbm)));
  const bool lost = random.chance(options.loss_chance);
  const bool zero = random.chance(options.zero_chance);
  if (!heard || lost) return std::nullopt;
  const double late_m = std::max(0.0, wall.excess_m + spread_m) + tail_m;
  const double clocked_m =
      clocked_distance_m(options.two_way, truth_m, 1e-6 * from.clock_ppm, 1e-6 * to.clock_ppm);
  const double measured_m = clocked_m + options.shared_bias_m + from.bias_m + to.bias_m + noise_m + late_m +
                            options.level_bias_share * level_bias_m(rss_dbm);
  constexpr double k_line_of_sight_m = 0.06;
  return Exchange{zero ? 0.0 : std::max(0.0, measured_m), rss_dbm,      truth_m,
                  wall.excess_m < k_line_of_sight_m,      wall.loss_db, late_m};
}

std::optional<Exchange> simulate_exchange(const World& world, const RadioOptions& options,
                                          const Eigen::Vector3d& tag_m, const WorldAnchor& anchor,
                                          double anchor_bias_m, Random& random) {
  return simulate_exchange(world, options, Terminal{tag_m, {}, 0}, Terminal{anchor.enu_m, {}, anchor_bias_m},
                           random);
}

}  // namespace anchord::sim
