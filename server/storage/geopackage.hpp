#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/ports/feature_file.hpp"
#include "core/types/feature_table.hpp"

namespace anchord {

/// A GeoPackage 1.3 (OGC 12-128r17) of these tables in EPSG:4979, with the layer_styles of QGIS: the bytes of
/// the file. Made in memory, since it is an SQLite database and readers want it whole.
///
/// errors   storage_unavailable where SQLite fails (out of memory). A row must have a value for each column.
/// threads  any
Result<std::string> geopackage(std::span<const FeatureTable> tables, UtcTime now);

/// The same with one table, on the disk and as large as it may be: a MakeFeatureFile. Without a journal and
/// synced nowhere, since it is sent and thrown away; its cache has 8 MB.
Result<std::unique_ptr<FeatureFile>> make_geopackage_file(const std::filesystem::path& path,
                                                          const FeatureTable& head, UtcTime now);

}  // namespace anchord
