#pragma once

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

}  // namespace anchord
