#pragma once

#include <span>
#include <string>

#include "api/anchors/anchor_json.hpp"
#include "api/exchange/anchor_drawing.hpp"

namespace anchord::api {

/// IFC4 (ISO 16739-1:2018) as STEP text (ISO 10303-21): a project with its map conversion, each site,
/// building and floor that the anchors name, and every anchor as an IfcCommunicationsAppliance (ANTENNA) of
/// 0.1 m with its accuracy as properties. Coordinates are metres along the grid of the map system, less a
/// whole number of metres that the IfcMapConversion holds. GlobalIds are the anchor's ifc_guid where it has
/// one, else made of its id, that of the project of its oldest site's; the same in every file; the text
/// depends on nothing but the anchors. The anchors have `projected`, of one EPSG code, and the height.
std::string anchors_ifc(std::span<const AnchorFeature> anchors, FileHeight height);

}  // namespace anchord::api
