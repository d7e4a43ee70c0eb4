#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/types/position.hpp"

namespace anchord {

/// A change of datum by seven parameters between earth-centred coordinates, rotations as of the position
/// vector (EPSG method 1033): X' = T + (1 + s) R X, R = [1 -rz ry; rz 1 -rx; -ry rx 1]. Rotations of the
/// coordinate frame (EPSG 1032) have the other sign.
struct DatumChange {
  Eigen::Vector3d translation_m{0, 0, 0};  ///< ECEF
  Eigen::Vector3d rotation_arcsec{0, 0, 0};
  double scale_ppm{0};

  Eigen::Vector3d ecef_m(const Eigen::Vector3d& before_ecef_m) const;
  Wgs84 wgs84(const Wgs84& before) const;
};

/// The translation that takes one place to another.
DatumChange datum_change_between(const Wgs84& before, const Wgs84& after);
/// A translation in east, north and up of a place.
DatumChange datum_change_at(const Wgs84& place, const Eigen::Vector3d& enu_m);

}  // namespace anchord
