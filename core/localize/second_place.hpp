#pragma once

#include <cstddef>
#include <optional>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Another place that ranges of an anchor agree on which the loss of the fit rejects.
struct SecondPlace {
  Eigen::Vector3d position_m{0, 0, 0};
  double apart_m{};      ///< from the solution
  double share{};        ///< of the anchor's ranges: rejected, and within the cut-off there
  double early_share{};  ///< of the anchor's ranges: shorter than from the solution by more than the cut-off
  std::optional<double> since_s{};  ///< the ranges before fit the solution, those from then on this place
  std::optional<double> until_s{};  ///< the other way round
  bool as_by_wall{};  ///< about as many are late alike, from the solution, and neither before nor after the
                      ///< rest
  std::optional<std::size_t> anchor{};  ///< which was found at this place, index
};

/// Fits one place to the ranges beyond the cut-off of the loss, from many starts, with a loss that redescends
/// (Cauchy of 0.3 m to come near, Tukey of twice the cut-off to stay with those that agree); bias, curve and
/// the anchor's own delay as the joint solution has them. The place on which most ranges agree is the answer.
///
/// An anchor that was moved, exchanged or addressed anew late in a flight leaves a minority of ranges that
/// the loss rejects, and a solution where it was; one mostly heard by a reflection leaves those on the
/// straight way. In both a minority agrees, which the late ranges behind a wall do not.
///
/// returns  nothing where fewer than a tenth of the ranges or 20 are rejected: then no limit is reached
/// threads  pure
std::optional<SecondPlace> second_place(const FlightRows& flight, const JointFit& fit, std::size_t index,
                                        const FlightOptions& options);

/// Gate "second_place": not passed where more than 13 % of the ranges agree on a place more than 1.5 m away,
/// unless a wall before the solution explains as much, or more than 10 % are early (walls only make ranges
/// late) and those rejected fit a place more than 1.2 m away.
Gate second_place_gate(const FlightRows& flight, const JointFit& fit, std::size_t index,
                       const FlightOptions& options);

}  // namespace anchord
