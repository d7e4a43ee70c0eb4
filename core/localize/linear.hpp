#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/observation.hpp"
#include "core/localize/solver_options.hpp"

namespace anchord {

/// Anchor position in closed form: the last equation subtracted from the others, ordinary least squares.
/// Source: eq 7.2-7.5. Exact for exact ranges; with noise it is a start, not an answer.
///
/// dims two  works in the plane: x and y of the tag positions, the answer's z is the mean tag height
/// errors    too_few_observations (fewer than dims + 1), weak_geometry (rank below dims), invalid_argument
/// (not finite)
Result<Eigen::Vector3d> linear_position(std::span<const Observation> observations, Dims dims = Dims::three);

/// Places to start an iterative solver from, best first; never empty for at least one finite observation.
///
/// Linear in x after centring, along the track's principal axes; where the track is flat along an axis the
/// linear system says nothing about that coordinate, so its size comes from the ranges and both signs are
/// given. Then their reflections through the flattest plane, the nearest track point, and a ring of guesses.
std::vector<Eigen::Vector3d> start_candidates(std::span<const Observation> observations,
                                              Dims dims = Dims::three);

}  // namespace anchord
