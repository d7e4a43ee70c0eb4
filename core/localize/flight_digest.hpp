#pragma once

#include <string>

#include "core/types/flight_data.hpp"

namespace anchord {

/// 32 hexadecimal digits that tell one recorded flight from another, whatever its folder is called: track and
/// ranges in their order, no names. Positions and distances to the bit, times since the first row: a flight
/// that is played again at another hour is the same one.
std::string flight_digest(const FlightData& flight);

/// The same with the times as they are: what profiles up to 0.2 tell flights apart by.
std::string dated_flight_digest(const FlightData& flight);

}  // namespace anchord
