#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/localize/error_question.hpp"
#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// What the ranges of a flight say about systematic errors, theirs and the track's.
struct SystematicErrors {
  ErrorFinding scale;  ///< factor less one of all ranges together
  ErrorFinding
      step;  ///< what ranges measured in the upper half of the flight's heights are longer by; metres
  ErrorFinding drift;          ///< what ranges grow by from the beginning of the flight to its end; metres
  ErrorFinding track_drift;    ///< what the track drifts by, in the way that is known least; metres
  ErrorFinding track_heights;  ///< factor less one of the heights of the track
  std::vector<std::vector<Gate>> gates;          ///< of each anchor: error_gates
  std::vector<Eigen::Matrix3d> covariance_m2{};  ///< what the region of each anchor is to hold for it beside
  std::optional<std::string> note{};             ///< where that makes anchors less certain
};

/// Errors that all residuals of a fit may hide, since place, bias and unit delay take most of them in. Asked
/// for are:
/// - a factor on all ranges, on those of one tag antenna, on those of one anchor: what a wrong clock, unit or
///   speed of light does, and a wrong antenna delay does not;
/// - a step between the lower and the upper half of the heights that were flown: a reflection of the ground
/// or
///   roof that is taken for the first path, an antenna's pattern; it moves the heights of anchors;
/// - a drift in time: a radio that warms up;
/// - a drift of the track in time along each axis, and a factor on its heights: positions that pass for RTK
///   fixed, heights of a barometer.
/// Each joins the unknowns of the fit, in its tempered weights, with a prior of 5 %, 0.3 m or, of the
/// track, 0.5 m (one sigma) about none. What looks odd is solved for again with the ranges corrected by it:
/// the misfit hides in the residual scale. A gate fails beyond four sigma and half a per cent or 0.1 m (of
/// the track 2 % and 0.15 m). Ranges below 5 m err by some per cent of their length on real radios (-0.07 m
/// at 2 m): that slope is an unknown beside it, so that a small hall alone shows no factor.
///
/// What the ranges cannot exclude is in the regions, as a shift of the track is (track_shift.hpp): before the
/// ranges one flight in eight has a factor, one in fifty a step or a drift, one in fifty such a track.
/// errors  canceled
Result<SystematicErrors> check_systematic_errors(const FlightRows& flight, const JointFit& fit,
                                                 const SharedPrior& prior, const FlightOptions& options);

}  // namespace anchord
