#pragma once

#include <Eigen/Core>

#include <span>

#include "core/base/result.hpp"
#include "core/localize/observation.hpp"

namespace anchord {

/// Anchor from one range, the bearing of the turn and the height of the search, eq 8.7. The equation adds the
/// whole distance in the plane; here the height difference is taken out first, which is the same where it is
/// small. bearing_rad clockwise from north; ENU metres. A distance shorter than the height difference puts it
/// overhead.
Eigen::Vector3d first_guess(const Eigen::Vector3d& tag_m, double distance_m, double bearing_rad,
                            double height_m);

/// Anchor from two ranges at a known height (8.4.2): of the two intersections the one nearer to `guess_m`.
/// Circles that just miss each other (noise) give the point between them. errors  weak_geometry (the two tag
/// positions lie above each other), no_convergence (circles further apart than
///         `slack_m`)
Result<Eigen::Vector3d> second_guess(const Eigen::Vector3d& tag1_m, double distance1_m,
                                     const Eigen::Vector3d& tag2_m, double distance2_m, double height_m,
                                     const Eigen::Vector3d& guess_m, double slack_m = 1.0);

/// Both in turn: the first guess from the range nearest to the turn, then its intersection with the range
/// taken furthest to the side of the bearing, where the bearing's 20 degrees say least. What lies further
/// from the first guess than a bearing can be wrong (0.7 of the range, 40 degrees) is not believed. rows  not
/// empty; same frame and axes as the turn
Eigen::Vector3d guess_from_turn(std::span<const Observation> rows, const Eigen::Vector3d& turn_m,
                                double bearing_rad, double height_m);

}  // namespace anchord
