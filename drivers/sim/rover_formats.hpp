#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>

#include "core/base/time.hpp"
#include "core/types/fix.hpp"
#include "core/types/position.hpp"
#include "drivers/sim/scenario.hpp"

namespace anchord::sim {

/// One epoch of a simulated receiver, as it would tell it. With fix none only the time counts.
struct RoverEpoch {
  UtcTime time{};
  FixClass fix{FixClass::rtk_fixed};
  Wgs84 position{};               ///< ellipsoidal height
  double geoid_separation_m{45};  ///< of the receiver's coarse geoid; height above sea = height - separation
  Eigen::Vector3d velocity_enu_mps{0, 0, 0};
  Eigen::Vector3d sigma_enu_m{0, 0, 0};
  int satellites{14};
  double hdop{0.9}, age_s{0.8};
};

/// The epoch in a format's own bytes, messages in the order of the maker's encoder:
///   nmea  RMC, GGA, GST, VTG with 7 decimals of minutes, as Reach sends; its GST has east before north
///   ubx   NAV-PVT, NAV-HPPOSLLH, NAV-COV
///   erb   VER, POS, STAT, DOPS, VEL, SVI (empty), RTK
///   llh   one line of RTKLIB solution text in UTC; nothing without a position
///   gpsd  TPV and GST
/// Pure.
std::string encode(const RoverEpoch& epoch, RoverFormat format);

/// What a client is told when it connects: llh its header, gpsd its VERSION; else nothing.
std::string greeting(RoverFormat format);
/// A gpsd's answer to one command of a client ("?WATCH={...}"); `device` as its path.
std::string gpsd_answer(std::string_view command, std::string_view device);

/// Frames of the binary formats, sums included.
std::string ubx_frame(std::uint8_t message_class, std::uint8_t id, std::string_view payload);
std::string erb_frame(std::uint8_t id, std::string_view payload);
std::string nmea_frame(std::string_view body);

}  // namespace anchord::sim
