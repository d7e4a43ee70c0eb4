#pragma once

#include <optional>

#include "drivers/sim/random.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::sim {

/// The radio of the simulated kit.
struct RadioOptions {
  double transmit_dbm = -14.3;        ///< UWB limit of -41.3 dBm/MHz over 500 MHz
  double carrier_hz = 3.9936e9;       ///< DW1000 channel 2
  double range_sigma_m = 0.035;       ///< line-of-sight noise of one exchange
  double shared_bias_m = 0.08;        ///< antenna delay of the kit, in every range
  double anchor_bias_sigma_m = 0.02;  ///< spread of it between anchors
  double rss_sigma_db = 1.2;
  double sensitivity_dbm = -102;  ///< half of the exchanges are lost at this level
  double loss_chance = 0.02;      ///< lost for no reason to be seen
  double zero_chance = 0.004;     ///< answered with 0 mm, the device's failure value
};

/// Friis, eq 2.5, isotropic antennas: received level at a distance in free space.
double friis_dbm(double transmit_dbm, double carrier_hz, double distance_m);

/// One exchange as the device would report it.
struct Exchange {
  double distance_m{};  ///< 0 is the failure value
  double rss_dbm{};
  double truth_m{};
  bool line_of_sight{};  ///< nothing but glass and plasterboard in between
};

/// Ranges of one anchor with fixed bias. Walls make ranges long and weak, with a spread that grows with the
/// excess; reflections add a one-sided tail. Nothing: the exchange was lost.
std::optional<Exchange> simulate_exchange(const World& world, const RadioOptions& options,
                                          const Eigen::Vector3d& tag_m, const WorldAnchor& anchor,
                                          double anchor_bias_m, Random& random);

}  // namespace anchord::sim
