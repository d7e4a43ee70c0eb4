#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/types/position.hpp"

namespace anchord::api {

/// Outer ring of a site's GeoJSON Polygon, east and north metres of `origin`; empty where it is none.
std::vector<Eigen::Vector2d> outline_in_enu(const std::string& geojson, const Wgs84& origin);

}  // namespace anchord::api
