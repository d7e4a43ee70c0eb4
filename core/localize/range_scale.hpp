#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// What the ranges say about a factor 1 + s on them, beside the anchors.
struct ScaleFinding {
  double value{};  ///< s; 0.02: every range is 2 % too long
  double sigma{};  ///< no larger than the prior's 0.05
  double z{};
};

/// What the ranges of a flight say about their scale.
struct RangeScale {
  ScaleFinding all;                              ///< of all ranges together
  std::vector<Gate> gates;                       ///< "range_scale" of each anchor
  std::vector<Eigen::Matrix3d> covariance_m2{};  ///< what the region of each anchor is to hold for it beside
  std::optional<std::string> note{};             ///< where that makes anchors less certain
};

/// Are the ranges long or short by a factor: all of them, those of one tag antenna, those of one anchor? A
/// wrong antenna delay does not do that; a wrong clock, unit or speed of light does. Place, bias and unit
/// delay take most of it in, and no residual is large. For each of these groups the factor joins the unknowns
/// of the fit, in its tempered weights, with a prior of 5 % (one sigma) about one. What looks odd is solved
/// for again with the ranges divided by it: the misfit hides in the residual scale. The gate fails beyond
/// four sigma and half a per cent, for all anchors where all ranges or those of one antenna are off, else for
/// the anchor. Ranges below 5 m err by some per cent of their length on real radios (-0.07 m at 2 m): that
/// slope is an unknown beside it, so that a small hall alone shows no factor.
///
/// A factor that the ranges cannot exclude is in the regions, as a shift of the track is (track_shift.hpp):
/// before the ranges one flight in eight has one.
/// errors  canceled
Result<RangeScale> check_range_scale(const FlightRows& flight, const JointFit& fit, const SharedPrior& prior,
                                     const FlightOptions& options);

}  // namespace anchord
