#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "api/anchors/anchor_json.hpp"
#include "core/base/enum_table.hpp"

namespace anchord::api {

/// Which height a file of survey or CAD has; neither is guessed from the other.
enum class FileHeight : std::uint8_t { ellipsoidal, orthometric };
inline constexpr auto k_file_height_words = enum_table<FileHeight>(
    {{"ellipsoidal", FileHeight::ellipsoidal}, {"orthometric", FileHeight::orthometric}});

/// The writers below take anchors that have what the file needs: `projected`, of one EPSG code, and the
/// height.
double file_height_m(const AnchorFeature& feature, FileHeight height);

/// DXF of AutoCAD R12, which every CAD program reads: a point and a text for each anchor, in metres of the
/// map system, on one layer for each building and floor.
std::string anchors_dxf(std::span<const AnchorFeature> anchors, FileHeight height);

/// Point number, northing, easting, elevation, description: the columns of surveyors, without a header. The
/// number is the network id as a decimal one, since many programs take no other.
std::string anchors_pnezd(std::span<const AnchorFeature> anchors, FileHeight height);

/// DeviceCoordinates of a Pozyx system: integer millimetres of the local frame (`local_m`).
std::string anchors_pozyx(std::span<const AnchorFeature> anchors);

}  // namespace anchord::api
