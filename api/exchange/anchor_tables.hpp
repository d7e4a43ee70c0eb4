#pragma once

#include <span>
#include <vector>

#include "api/anchors/anchor_json.hpp"
#include "core/types/feature_table.hpp"

namespace anchord {
class MeasurementStore;
class MissionStore;
}  // namespace anchord

namespace anchord::api {

/// Tables for a GeoPackage: `anchors` with their covariance, `ellipses95` as polygons, and `tracks` of the
/// flights they were calibrated from.
std::vector<FeatureTable> anchor_tables(std::span<const AnchorFeature> anchors, MissionStore& missions,
                                        MeasurementStore& measurements);

}  // namespace anchord::api
