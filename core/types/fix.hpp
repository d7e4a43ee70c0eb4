#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// Quality of a position, in the order of trust. `fixed` is RTK with integer ambiguities, or motion capture.
enum class FixClass : std::uint8_t { none, single, dgps, rtk_float, rtk_fixed };
inline constexpr auto k_fix_words = enum_table<FixClass>({{"none", FixClass::none},
                                                          {"single", FixClass::single},
                                                          {"dgps", FixClass::dgps},
                                                          {"float", FixClass::rtk_float},
                                                          {"fixed", FixClass::rtk_fixed}});

/// One position epoch as received: immutable, stored as it came.
struct Fix {
  MissionId mission{};
  UtcTime time{};                      ///< measured
  std::optional<UtcTime> received{};   ///< arrival, where it differs
  std::optional<std::uint64_t> seq{};  ///< of the source; part of the identity
  TrackFrame frame{TrackFrame::wgs84};
  Wgs84 position{};                  ///< valid when frame == wgs84
  Eigen::Vector3d local_m{0, 0, 0};  ///< valid when frame == local
  FixClass fix{FixClass::none};
  /// ENU (or local x, y, z) covariance, m^2; absent when the source gave none.
  std::optional<Eigen::Matrix3d> covariance_m2{};
  /// Rotation from body (forward, left, up) to ENU or local; absent when attitude is unknown.
  std::optional<Eigen::Quaterniond> enu_from_body{};
  std::optional<double> correction_age_s{};
  std::optional<int> satellites{};
};

}  // namespace anchord
