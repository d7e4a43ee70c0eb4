#pragma once

#include <functional>
#include <vector>

#include "core/base/result.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::api {

/// What of a mission's record a solve takes.
struct FlightLoading {
  std::function<bool()> canceled;
  std::vector<Exclusion> exclusions{};  ///< rows of those that apply are left out and counted
  bool between_anchors{true};           ///< ranges between anchors too
  bool with_cir{false};                 ///< impulse responses, for `correct`
  /// Asked for each part of the ranges before no more is kept of them than a solve asks; may correct them
  /// (correct_flight).
  std::function<void(FlightData& part)> correct{};
};

/// All rows of a mission. A long flight is the largest thing in memory: its ranges are read part by part.
Result<FlightData> load_flight(MeasurementStore& store, const Mission& mission, const FlightLoading& how);

/// Adds the ranges of `part`, kept as rows, and what models made of them.
void append_rows(FlightData& flight, FlightData part);

}  // namespace anchord::api
