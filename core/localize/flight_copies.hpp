#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/types/flight_data.hpp"

namespace anchord {

/// For each flight which other one of them has its measurements already; absent: it counts. Copies are two
/// flights that have more than half of the ranges of the smaller one in common (tag, anchor, distance as
/// received and the times between): an import repeated, a flight played again at another hour, an upload cut
/// off and begun anew, the same ranges beside a track that was processed again. Of those the one with the
/// most ranges counts, of equals the first.
std::vector<std::optional<std::size_t>> flight_copies(std::span<const FlightData* const> flights);

/// For people, of a copy.
std::string copy_note(const std::string& original);

}  // namespace anchord
