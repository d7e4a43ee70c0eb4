#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/floor_plan/dxf.hpp"
#include "core/floor_plan/image.hpp"

namespace anchord::floor_plan {

/// A drawing as a picture: black on white, 2 cm a pixel where it is no larger than 180 m.
struct DrawnPlan {
  Image image;  ///< 3 channels
  /// drawing in metres = matrix * (x, y, 1), pixels as in georeference.hpp; y of drawings points up.
  Eigen::Matrix<double, 2, 3> drawing_m_from_pixel = Eigen::Matrix<double, 2, 3>::Zero();
  bool is_at_site{false};  ///< in the map system of the site
};

/// What lies far outside of the rest (a forgotten line, the sheet's legend at another origin) is left out.
/// Between two parallel lines 7 to 60 cm apart, those of wall layers where there are any, the wall is filled:
/// trace_plan looks for walls of ink, and CAD draws their faces.
///
/// The unit is the one that puts the drawing within 5 km of the site, for GIS programs write whatever unit
/// into a DXF of metres; else the one of the file; else metres below 1000 units across, millimetres beyond.
///
/// site_map_m  easting and northing of the site in its map system
/// errors   weak_geometry (nothing of any size)
/// memory   3 bytes a pixel, at most 100 million of them
/// threads  pure
Result<DrawnPlan> draw_plan(const Drawing& drawing, const std::optional<Eigen::Vector2d>& site_map_m = {});

}  // namespace anchord::floor_plan
