#pragma once

#include <optional>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Do the ranges fit the track far better at another time, seconds away from their own? GPS time
/// against UTC (18 s), or a clock that nobody set. The fit looks for tenths of a second, and where an
/// aircraft flies along straight sides the loss may find a cluster of ranges that agree about a wrong place.
///
/// Offsets of 1 s to a minute are asked by the closed form of each anchor (linear in its position), so that
/// no start and no loss has a say: one has to place nine tenths as many ranges as the solution does, and to
/// leave less than 0.4 of its misfit. Not asked where that is below 0.2 m.
///
/// returns  a gate (clock, in seconds) that failed, or nothing
std::optional<Gate> check_clock(const FlightRows& flight, const JointFit& fit);

}  // namespace anchord
