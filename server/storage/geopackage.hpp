#pragma once

#include <span>
#include <string>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/feature_table.hpp"

namespace anchord {

/// A GeoPackage 1.3 (OGC 12-128r17) of these tables in EPSG:4979, with the layer_styles of QGIS: the bytes of
/// the file. Made in memory, since it is an SQLite database and readers want it whole.
///
/// errors   storage_unavailable where SQLite fails (out of memory). A row must have a value for each column.
/// threads  any
Result<std::string> geopackage(std::span<const FeatureTable> tables, UtcTime now);

}  // namespace anchord
