#pragma once

#include <array>
#include <optional>

namespace anchord {

/// The reference station behind corrections, as it tells of itself (RTCM 3 message 1005 or 1006).
struct BaseStation {
  int station{};                             ///< number of the caster, 0 to 4095
  std::array<double, 3> ecef_m{};            ///< antenna reference point, in the frame the network works in
  std::optional<double> antenna_height_m{};  ///< above its marker; message 1006 alone has it
  bool operator==(const BaseStation&) const = default;
};

}  // namespace anchord
