#pragma once

#include <cmath>

#include "core/types/position.hpp"

namespace anchord {

/// An area between two meridians and two parallels, degrees, its edges included. West of an area over the
/// antimeridian is greater than its east (RFC 7946, 5.2).
struct LonLatBox {
  double west{}, south{}, east{}, north{};

  bool holds(const Wgs84& at) const { return meets({at.lon_deg, at.lat_deg, at.lon_deg, at.lat_deg}); }
  /// Whether it has a part of another one, which does not cross the antimeridian.
  bool meets(const LonLatBox& of) const {
    const bool along = west > east ? of.east >= west || of.west <= east : of.east >= west && of.west <= east;
    return along && of.north >= south && of.south <= north;
  }
};

/// As it is asked for: also over the antimeridian with an east beyond 180 degrees (170 to 190) or a west
/// beyond -180, as many clients write it.
inline LonLatBox lon_lat_box(double west, double south, double east, double north) {
  if (east - west >= 360.0) return {-180, south, 180, north};
  const auto turned = [](double lon_deg) {
    return std::abs(lon_deg) <= 180.0 ? lon_deg : std::remainder(lon_deg, 360.0);
  };
  return {turned(west), south, turned(east), north};
}

}  // namespace anchord
