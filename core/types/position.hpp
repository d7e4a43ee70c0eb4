#pragma once

#include <Eigen/Core>

#include "core/base/enum_table.hpp"

namespace anchord {

/// Geodetic position on WGS84; ellipsoidal height, not above sea level.
struct Wgs84 {
  double lat_deg{}, lon_deg{}, height_m{};
};

/// East, north, up of a site's origin; or x, y, z of a local frame where no origin on the globe is known.
struct Enu {
  Eigen::Vector3d m{0, 0, 0};
};

/// What the numbers of a track are.
enum class TrackFrame {
  wgs84,  ///< on the globe
  local,  ///< metres of a frame without a place on the globe (motion capture, odometry)
};
inline constexpr auto k_frame_words =
    enum_table<TrackFrame>({{"wgs84", TrackFrame::wgs84}, {"local", TrackFrame::local}});

}  // namespace anchord
