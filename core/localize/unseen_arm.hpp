#pragma once

#include <vector>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// One sigma of the forward and left part of an arm that nobody declared: nearly every tag is mounted within
/// 0.3 m of the track point (0.02 to 0.49 m on the aircraft seen so far).
inline constexpr double k_undeclared_arm_sigma_m = 0.15;

/// Widens the positions of a fit by the declared uncertainty of the lever arm's forward and left part
/// (FlightOptions::lever_arm_sigma_m), along the way everything follows the arm. Of a track without attitude
/// in the plane, for at one heading an arm moves an anchor by its own length, and as far as an arm reaches
/// that turned along the course or towards the middle of the track, which moves heights by several times its
/// length (of 210 made anchors accepted without this, 16 were beyond 1.5 times a bound). Nothing where none
/// is declared: a centimetre or two of a tape measure is in the floor.
/// prior  what the fit was solved with
/// fit    its anchor_covariance and arm_covariance_m2 grow
void add_arm_doubt(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options,
                   JointFit& fit);

/// How far each anchor would move by an error of the declared lever arm that the flight does not show: the
/// external reliability of the arm (Baarda 1968). Of errors up to 0.3 m (a wrong entry in a form) in any
/// direction of the body, those that check_lever_arm could pass over count; the worst of them is held
/// against the anchor's own 95 % region. An aircraft that keeps one heading shows none of it, and moves
/// all anchors alike. A track without attitude has no arm but the upward part: what is declared across is
/// then the error, whether the aircraft kept its heading, turned along its course or to the middle.
///
/// Of 298 made anchors with an arm wrong by 0.3 m and one heading 289 are held back, and none is accepted
/// beyond 1.5 regions; without the gate nearly all are accepted, 3 % of them inside. As many are held back
/// where the arm is right, for nothing tells the two apart. A quarter turn of the heading for half of the
/// flight lets 297 of the 298 right ones pass, for 20 s 291, a full turn within 12 s only 161; along the
/// course 294.
///
/// returns  gate unseen_arm of each anchor, in metres; nothing where the arm is estimated, where its
///          uncertainty is declared and the whole arm applied, or where the track is the tag's own
std::vector<Gate> unseen_arm_gates(const FlightRows& flight, const JointFit& fit, const SharedPrior& prior,
                                   const FlightOptions& options);

}  // namespace anchord
