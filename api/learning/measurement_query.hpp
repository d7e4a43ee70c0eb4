#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "api/kit/router.hpp"
#include "api/learning/model_registry.hpp"
#include "core/ports/measurement_limits.hpp"

namespace anchord::api {

/// min_distance_m, max_distance_m, min_level_dbm, max_level_dbm, label. 422 naming what is not one.
MeasurementLimits query_limits(const Request& request);
/// `every`: 1 where it is not given.
std::size_t query_every(const Request& request);

/// What the promoted models call a measurement; unclear: P(LOS) of 0.4 to 0.6, or they say nothing.
enum class PredictedClass : std::uint8_t { los, nlos, unclear };
inline constexpr auto k_predicted_words = enum_table<PredictedClass>(
    {{"los", PredictedClass::los}, {"nlos", PredictedClass::nlos}, {"unclear", PredictedClass::unclear}});
std::optional<PredictedClass> query_class(const Request& request);
PredictedClass class_of(const ModelAnswer& judgement);
/// {"class","p_los","bias_m"}
nlohmann::ordered_json predicted_json(const ModelAnswer& judgement);

/// Measurements that a class is looked for in, for one page: beyond it the page is handed out as it is, with
/// its cursor.
inline constexpr std::size_t k_class_scan_max = 20'000;

}  // namespace anchord::api
