#pragma once

#include <cstddef>
#include <optional>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Delay d of one anchor's ranges alone (cable, antenna delay register, other firmware, one wall before it)
/// as its ranges want it: without the prior that holds d near the others' (delay_prior_m), place free, what
/// is shared held. One Newton step from the solution, whose normal equations are N = [N_xx n; n^T N_dd],
/// prior 1/s^2 on d in N_dd:
///
///   I = N_dd - 1/s^2 - n^T N_xx^-1 n,   delay = d (1 + 1/(s^2 I)),   sigma = I^-1/2,
///
/// and the place goes by -N_xx^-1 n (delay - d). Metres; N tempered, so sigma is wide.
struct OwnDelay {
  double delay_m{};
  double sigma_m{};
  Eigen::Vector4d moved{Eigen::Vector4d::Zero()};  ///< place and delay from the solution to there
};

/// returns  nothing where the ranges tell place and delay not apart at all
std::optional<OwnDelay> own_delay(const JointFit& fit, std::size_t index, const FlightOptions& options);

/// A delay stands out beyond 0.25 m and 1.1 sigma; in rooms, where the median range is below 5 m and
/// reflections come soon after the straight way, beyond 0.5 m and 0.75 sigma. Metres.
double own_delay_limit_m(const OwnDelay& own, const AnchorRows& anchor);

/// Lets one sigma of the region of an anchor whose delay stands out reach to where that would put it.
/// Anchors whose ranges were mostly predicted by an error model have no part in it. Of `fit` only
/// anchor_covariance grows.
/// returns  how many anchors became less certain by a tenth or more (root of the trace)
std::size_t add_own_delay_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit);

/// Gate "own_delay": not passed where the delay stands out. Nothing in rooms: the region holds it.
std::optional<Gate> own_delay_gate(const FlightRows& flight, const JointFit& fit, std::size_t index,
                                   const FlightOptions& options);

/// Do error models judge half of the anchor's ranges or more? Late ranges are no surprise there.
bool mostly_modelled(const AnchorRows& anchor);

}  // namespace anchord
