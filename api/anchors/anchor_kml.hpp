#pragma once

#include <string>
#include <vector>

#include "api/anchors/anchor_json.hpp"

namespace anchord::api {

/// Anchors on the globe as KML 2.2 placemarks. KML's absolute altitude is above sea level: given only where
/// the geoid is known, otherwise the marks lie on the ground and say so.
std::string anchors_kml(const std::vector<AnchorFeature>& features);

}  // namespace anchord::api
