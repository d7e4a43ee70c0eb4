#pragma once

#include "core/base/result.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::flight {

/// Three and a half minutes round the demonstration building with six anchors: the same numbers each time.
Result<FlightData> demonstration_flight();

}  // namespace anchord::flight
