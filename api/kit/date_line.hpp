#pragma once

#include <cmath>

namespace anchord::api {

/// Longitude of a vertex of a line or ring, within 180 degrees of the vertex before it: over the date line it
/// goes on beyond 180 degrees, for from 180 to -180 a map would draw the line round the globe. Once round it,
/// as near a pole, it begins again: beyond 360 degrees no map has a place.
inline double beside(double lon_deg, double before_deg) {
  const double out_deg = lon_deg + 360.0 * std::round((before_deg - lon_deg) / 360.0);
  return std::abs(out_deg) > 360.0 ? lon_deg : out_deg;
}

}  // namespace anchord::api
