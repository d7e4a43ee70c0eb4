#pragma once

#include <optional>

#include "drivers/sim/random.hpp"
#include "drivers/sim/two_way.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::sim {

/// The radio of the simulated kit. docs/radio-model.md has the formulas and where they come from.
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
  double turn_lobe_db = 0;        ///< depth of the tag's two-lobe pattern (Fig 8.4); 0: equal all round
  bool height_lobe = false;       ///< upright dipoles at both ends (Fig 8.5); false: isotropic
  /// What is left of the DW1000's error over received level (0..1) after the firmware's own correction, which
  /// no public source describes.
  double level_bias_share = 0;
  TwoWayExchange two_way{};  ///< what the crystals of both ends do to a range
};

/// Friis, eq 2.5, isotropic antennas: received level at a distance in free space.
double friis_dbm(double transmit_dbm, double carrier_hz, double distance_m);

/// Gain of the tag over its orientation (heading - bearing of the other end, both clockwise from north):
/// 0 dB in the lobes at 120 and 250 degrees, -depth_db between them and in front. Fig 8.4.
double turn_gain_db(double orientation_rad, double depth_db);

/// Gain of an upright half-wave dipole at an elevation: 0 dB on the level, never below -20 dB. Fig 8.5.
double dipole_gain_db(double elevation_rad);

/// Error of a DW1000 range over received level, 500 MHz channels, PRF 64 MHz: the maker's table, linear
/// between its rows, the ends beyond. Reported minus true: strong signals read short.
double level_bias_m(double received_dbm);

/// One end of an exchange.
struct Terminal {
  Eigen::Vector3d enu_m{0, 0, 0};       ///< of the antenna
  std::optional<double> heading_rad{};  ///< clockwise from north; absent: no pattern over the turn
  double bias_m{};                      ///< antenna delay of this device
  double clock_ppm{};                   ///< its crystal, fast is positive
};

/// One exchange as the device would report it, and what only a simulator knows.
struct Exchange {
  double distance_m{};  ///< 0 is the failure value
  double rss_dbm{};
  double truth_m{};
  bool line_of_sight{};  ///< nothing but glass and plasterboard in between
  double wall_loss_db{};
  double late_m{};  ///< of the range: excess of the walls and of reflections
};

/// Mean received level without fading: Friis, both antenna patterns, walls.
double mean_level_dbm(const RadioOptions& options, const Terminal& from, const Terminal& to,
                      const Obstruction& wall);

/// One exchange between two devices. Walls make ranges long and weak, with a spread that grows with the
/// excess; reflections add a one-sided tail. Nothing: the exchange was lost. The same number of draws on
/// every call, so that a lost exchange does not shift the numbers of all later ones.
std::optional<Exchange> simulate_exchange(const World& world, const RadioOptions& options,
                                          const Terminal& from, const Terminal& to, Random& random);

/// The same for a tag whose heading does not matter.
std::optional<Exchange> simulate_exchange(const World& world, const RadioOptions& options,
                                          const Eigen::Vector3d& tag_m, const WorldAnchor& anchor,
                                          double anchor_bias_m, Random& random);

}  // namespace anchord::sim
