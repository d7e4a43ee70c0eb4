#pragma once

#include <Eigen/Core>

#include "core/types/position.hpp"

namespace anchord::sim {

/// Where a point of the simulated site is on the globe. Written from the textbook (closed form forwards,
/// Bowring's iteration back), apart from core/geo on purpose: a simulator that shares the solver's geometry
/// hides its errors. Accuracy: below 1 um within 10 km of the origin (wgs84_test.cpp).
Wgs84 wgs84_from_enu(const Wgs84& origin, const Eigen::Vector3d& enu_m);

}  // namespace anchord::sim
