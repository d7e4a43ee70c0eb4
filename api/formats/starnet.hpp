#pragma once

#include <map>
#include <optional>
#include <string>

#include "api/formats/evidence.hpp"
#include "core/base/result.hpp"
#include "core/types/anchor.hpp"

namespace anchord {

/// What a listing says beside the calibration and its evidence.
struct StarnetOptions {
  std::string program;                     ///< "anchord 0.2.0"
  std::map<NetworkId, std::string> names;  ///< of anchors, as descriptions
  std::optional<NetworkId> anchor{};       ///< only this one
};

/// Observations and residuals of a calibration as input of STAR*NET (3-D, local job, metres, slope
/// distances): tag places as fixed stations, anchors as free ones at their estimate, each range that was used
/// as a distance with its standard error, and the residuals as comments. Source: STAR*NET V6 Reference
/// Manual, chapter 5 (codes C and D, `!` fixed, `*` free, inline options, `#` comments, names up to 15
/// characters).
///
/// Distances are less bias, curve, unit delay and what a model took off. The standard error is
/// sigma / sqrt(robust weight), so that an adjustment without a loss of its own comes to the position of the
/// calibration, where all of its ranges are listed and it is of one flight. Rejected ranges are comments.
/// Coordinates are those of the solve, east, north, up of the calibration's origin, or local metres: straight
/// lines are straight there, whereas a map has a scale.
///
/// evidence  of this calibration, a flight for each of its missions
/// errors    invalid_argument: the evidence is of a version that kept no tag places, or is none
/// threads   pure
Result<std::string> starnet_listing(const Calibration& calibration, const Evidence& evidence,
                                    const StarnetOptions& options);

}  // namespace anchord
