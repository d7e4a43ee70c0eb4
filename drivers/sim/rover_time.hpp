#pragma once

#include <cstdint>
#include <string>

#include "core/base/time.hpp"

namespace anchord::sim {

struct RoverEpoch;

struct CivilTime {
  int year{}, month{}, day{}, hour{}, minute{}, second{};
  int nanosecond{};
};
CivilTime civil(UtcTime time);

struct GpsTime {
  int week{};
  std::uint32_t tow_ms{};
};
/// 18 s ahead of UTC since 2017, and nothing older is simulated.
GpsTime gps_time(UtcTime time);

// encode() of the binary formats.
std::string encode_ubx(const RoverEpoch& epoch);
std::string encode_erb(const RoverEpoch& epoch);

}  // namespace anchord::sim
