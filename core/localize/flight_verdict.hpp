#pragma once

#include "core/localize/flight_solver.hpp"
#include "core/localize/joint_model.hpp"

namespace anchord {

/// Judges one solved anchor: geometry, mirror solutions, covariance, verdict. Fills everything of
/// AnchorSolution.
///
/// Mirrors are looked for: from the reflection through the track's plane and from the solution turned about
/// the track's main axis in steps of 45 degrees; what ends elsewhere with a tempered cost within 3 is one.
AnchorSolution assess_anchor(const FlightRows& flight, const JointFit& fit, std::size_t index,
                             const FlightOptions& options);

}  // namespace anchord
