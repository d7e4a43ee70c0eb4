#pragma once

#include <map>
#include <optional>

#include "core/base/ids.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/side_priors.hpp"
#include "core/procedure/prior_book.hpp"

namespace anchord::procedure {

/// What a flight told of one anchor beside its ranges, on the globe: kept with the mission, and good for
/// whatever frame the answers are in.
struct FlightPrior {
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
using FlightPriors = std::map<NetworkId, FlightPrior>;

/// Bearings and heights concluded so far. `plan`: the frame of the engine's metres.
/// A height whose best level lay at an end of the search, or whose peak does not stand out of the noise or is
/// narrower than antennas make it, is left out.
FlightPriors flight_priors(const std::map<NetworkId, Priors>& priors, const EnuFrame& plan);

/// The same as priors in the frame of the answers. North of two frames a kilometre apart differs by a
/// hundredth of a degree: bearings are taken over as they are.
std::map<NetworkId, AnchorPriors> priors_in(const FlightPriors& priors, const EnuFrame& answers);

/// What `newer` says replaces what `older` said, anchor by anchor and kind by kind.
FlightPriors merged(FlightPriors older, const FlightPriors& newer);

}  // namespace anchord::procedure
