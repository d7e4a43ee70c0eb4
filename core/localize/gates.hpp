#pragma once

#include <span>
#include <vector>

#include "core/localize/flight_solver.hpp"
#include "core/localize/joint_model.hpp"

namespace anchord {

/// Limits of the acceptance gates.
struct GateLimits {
  double redundancy{30};          ///< ranges beyond the unknowns; fewer cannot show that one of them is wrong
  double rejected_share{0.5};     ///< beyond: the rejected are the majority, and may be the right ones
  double side_probability{0.99};  ///< of the chosen side against its mirror solution
  double outline_sigmas{3};       ///< outside of the building by more: the outline is wrong, or the answer
  double residual_scale_m{0.6};   ///< radios that work stay below 0.25 m
  double precision{0.08};         ///< largest sigma over the median range; real flights that tell: 0.072
  double scale_ratio{2.25};  ///< residual scale over the other anchors'; 1.96 seen, 2.65 and up if blocked
  double late_scale_ratio{1.5};  ///< the same where the ranges want to be shorter by more than
  double late_z{1.2};  ///< this many sigmas; real anchors scatter so (1.96) or are late (1.08), not both
  double probability{0.999};  ///< of the chi-square tests: one good anchor in a thousand is held back
  /// Of a flight against its kit. Its covariances are tempered, so that real flights stay below half of
  /// this limit (3.2 of 7.8), while a bias of 0.3 m where a flight can tell it reaches 6 to 9. Not of the
  /// halves: walls that block one of them only make good anchors reach 15.
  double agreement{0.90};
};

/// Every gate one flight can ask of one anchor, in a fixed order: redundancy, rejected, geometry, precision,
/// side, held_height (in the plane), outline (where there is one), blocked, own_delay (not in rooms),
/// residual_scale, chi_square, halves, second_place, bias, settled.
///
/// chi_square  means of the residuals over two correlation times, each against the residual scale: white
///             noise averages out there, an error of the model does not
/// precision   of the place in space; in the plane where heights are held (Dims::two)
/// blocked     residual scale beside the other anchors', and what delay the ranges want of their own
/// halves      the anchor from the first and from the second half of the flight, by their distance in the
///             metric of both covariances: an anchor that moved, a clock that slipped, a base that jumped
/// solution    estimate, geometry and residuals filled
std::vector<Gate> gates_of(const FlightRows& flight, const JointFit& fit, std::size_t index,
                           const AnchorSolution& solution, const FlightOptions& options,
                           const GateLimits& limits = {});

/// Did the anchor move between two answers in one frame? Passed when their difference is within what both
/// covariances allow in space, horizontally and in height, each by itself; value and limit are of the one
/// that is nearest to its limit, or furthest beyond. Either without a position: not passed, no value.
Gate moved_gate(const Estimate& now, const Estimate& before, const GateLimits& limits = {});

/// The agreement of several flights about their common answer: chi2 with 3 (n - 1) degrees of freedom.
Gate flights_gate(double chi2, std::size_t n_flights, const GateLimits& limits = {});
/// A flight that has two places for an anchor, against the common answer of the others: horizontally, the
/// nearer of its places; chi2 with 2 degrees of freedom. The gate is `flights` too.
Gate ambiguous_flight_gate(double chi2, double apart_m, const GateLimits& limits = {});

/// Quantile of chi-square, Wilson-Hilferty; within 2 % for 3 and more degrees of freedom.
double chi2_quantile(double probability, double dof);

/// What every placed range of one anchor says at the solution, by time. The standardised residual is e over
/// its sigma times sqrt(1 - leverage): beyond about 3.3 the default loss gives it no weight (Baarda's data
/// snooping at 99.9 %, repeated in every round of the fit).
std::vector<RangeResidual> residuals_of(const FlightRows& flight, const JointFit& fit, std::size_t index,
                                        const FlightOptions& options);

}  // namespace anchord
