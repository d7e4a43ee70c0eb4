#pragma once

#include <map>
#include <optional>

#include "core/base/ids.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/side_clues.hpp"
#include "core/procedure/clue_book.hpp"

namespace anchord::procedure {

/// What a flight told of one anchor beside its ranges, on the globe: kept with the mission, and good for
/// whatever frame the answers are in.
struct FlightClue {
  struct Bearing {
    Wgs84 from{};          ///< where the aircraft turned
    double bearing_rad{};  ///< of the anchor, clockwise from north
    double sigma_rad{};
  };
  std::optional<Bearing> bearing{};
  struct Height {
    Wgs84 at{};  ///< where the aircraft climbed, at the height of the anchor
    double sigma_m{};
  };
  std::optional<Height> height{};
};
using FlightClues = std::map<NetworkId, FlightClue>;

/// Bearings and heights concluded so far. `plan`: the frame of the engine's metres.
/// A height whose best level lay at an end of the search, or whose peak does not stand out of the noise, is
/// left out.
FlightClues flight_clues(const std::map<NetworkId, Clues>& clues, const EnuFrame& plan);

/// The same as priors in the frame of the answers. North of two frames a kilometre apart differs by a
/// hundredth of a degree: bearings are taken over as they are.
std::map<NetworkId, AnchorClues> clues_in(const FlightClues& clues, const EnuFrame& answers);

/// What `newer` says replaces what `older` said, anchor by anchor and kind by kind.
FlightClues merged(FlightClues older, const FlightClues& newer);

}  // namespace anchord::procedure
