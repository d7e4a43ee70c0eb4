#pragma once

#include <vector>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Widens the positions of a fit by the declared uncertainty of the lever arm's forward and left part
/// (FlightOptions::lever_arm_sigma_m), along the way everything follows the arm. Nothing where none is
/// declared: a centimetre or two of a tape measure is in the floor.
/// prior  what the fit was solved with
/// fit    its anchor_covariance and arm_covariance_m2 grow
void add_arm_doubt(const SharedPrior& prior, const FlightOptions& options, JointFit& fit);

/// How far each anchor would move by an error of the declared lever arm that the flight does not show: the
/// external reliability of the arm (Baarda 1968). Of errors up to 0.3 m (a wrong entry in a form) in any
/// direction of the body, those that check_lever_arm could pass over count; the worst of them is held
/// against the anchor's own 95 % region. An aircraft that keeps one heading shows none of it, and moves
/// all anchors alike. A track without attitude has no arm but the upward part: what is declared across is
/// then the error.
/// returns  gate unseen_arm of each anchor of the flight, in metres; nothing where the arm is estimated,
/// where
///          its uncertainty is declared, or where the track is the tag's own
std::vector<Gate> unseen_arm_gates(const FlightRows& flight, const JointFit& fit, const SharedPrior& prior,
                                   const FlightOptions& options);

}  // namespace anchord
