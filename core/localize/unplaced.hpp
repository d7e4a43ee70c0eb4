#pragma once

#include <string>

#include "core/localize/flight_rows.hpp"

namespace anchord {

/// Ranges of a flight that never came near a solver, and why in words; empty text where most of them did.
struct Unplaced {
  std::size_t n_ranges{},
      n_placed{};   ///< between tag and anchors; those the track has a place for, without lag
  std::string why;  ///< largest reason with its numbers, its limit and what to do
};
Unplaced unplaced_of(const FlightRows& rows, const FlightData& flight, const FlightOptions& options);

}  // namespace anchord
