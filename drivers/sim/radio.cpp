#include "drivers/sim/radio.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord::sim {

double friis_dbm(double transmit_dbm, double carrier_hz, double distance_m) {
  constexpr double k_light_mps = 299'792'458.0;
  const double wavelength_m = k_light_mps / carrier_hz;
  return transmit_dbm +
         20.0 * std::log10(wavelength_m / (4.0 * std::numbers::pi * std::max(distance_m, 0.01)));
}

std::optional<Exchange> simulate_exchange(const World& world, const RadioOptions& options,
                                          const Eigen::Vector3d& tag_m, const WorldAnchor& anchor,
                                          double anchor_bias_m, Random& random) {
  const double truth_m = (tag_m - anchor.enu_m).norm();
  const Obstruction wall = obstruction_between(world, tag_m, anchor.enu_m);
  // Every draw happens on every call, so that a lost exchange does not shift the numbers of all later ones.
  const double noise_m = options.range_sigma_m * random.normal();
  const double spread_m = 0.25 * wall.excess_m * random.normal();
  const double tail_m = random.exponential(0.15 * wall.excess_m);
  const double rss_dbm = friis_dbm(options.transmit_dbm, options.carrier_hz, truth_m) - wall.loss_db +
                         options.rss_sigma_db * random.normal();
  const bool heard = random.chance(1.0 / (1.0 + std::exp(options.sensitivity_dbm - rss_dbm)));
  const bool lost = random.chance(options.loss_chance);
  const bool zero = random.chance(options.zero_chance);
  if (!heard || lost) return std::nullopt;
  const double excess_m = std::max(0.0, wall.excess_m + spread_m) + tail_m;
  const double measured_m = truth_m + options.shared_bias_m + anchor_bias_m + noise_m + excess_m;
  constexpr double k_line_of_sight_m = 0.06;
  return Exchange{zero ? 0.0 : std::max(0.0, measured_m), rss_dbm, truth_m,
                  wall.excess_m < k_line_of_sight_m};
}

}  // namespace anchord::sim
