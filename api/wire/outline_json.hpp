#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/types/geo_rings.hpp"
#include "core/types/position.hpp"

namespace anchord::api {

/// Outer ring of a site's outline, east and north metres of `origin`; empty where it has none.
std::vector<Eigen::Vector2d> outline_in_enu(const GeoRings& rings, const Wgs84& origin);

}  // namespace anchord::api
