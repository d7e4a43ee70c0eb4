#pragma once

#include <string>

#include "core/types/flight_data.hpp"

namespace anchord {

/// 32 hexadecimal digits that tell one recorded flight from another, whatever its folder is called: track and
/// ranges in their order, no names. Positions and distances to the bit.
std::string flight_digest(const FlightData& flight);

}  // namespace anchord
