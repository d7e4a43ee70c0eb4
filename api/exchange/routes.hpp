#pragma once

#include <functional>
#include <span>
#include <string>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/feature_table.hpp"

namespace anchord {
class MeasurementStore;
class MissionStore;
class PlaceStore;
}  // namespace anchord

namespace anchord::api {

struct AnchorApi;
class Router;

/// What the routes for other people's programs work with; lives as long as the router.
struct ExchangeApi {
  AnchorApi& anchors;
  MissionStore& missions;
  MeasurementStore& measurements;
  PlaceStore& places;
  /// The bytes of a GeoPackage; of the layer that has SQLite.
  std::function<Result<std::string>(std::span<const FeatureTable>, UtcTime)> geopackage;
};

/// OGC API Features at /ogc, read-only.
void add_ogc_routes(Router& router, ExchangeApi& api);
/// Published anchors as files of GIS, CAD and survey programs, under /api/v1/exports.
void add_anchor_file_routes(Router& router, ExchangeApi& api);

}  // namespace anchord::api
