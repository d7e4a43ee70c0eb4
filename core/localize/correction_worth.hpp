#pragma once

#include <string>

#include "core/localize/flight_solver.hpp"

namespace anchord {

/// Whether corrections of a flight's ranges explain it better than the ranges as they came.
struct CorrectionWorth {
  std::size_t n_ranges{}, n_blocks{};
  double gain{};   ///< mean of ln likelihood with minus without, per range
  double sigma{};  ///< of that mean
  bool shown{};    ///< gain beyond 1.645 sigma: 95 % sure that it is none by chance
  std::string text() const;
};

/// Compares the residuals of two solutions of one flight, range by range.
///
/// A range with an error model counts the density its error model gives the error that is left, any other
/// Student's t with three degrees of freedom, its scale that of the anchor's residuals by maximum likelihood,
/// on either side. Errors stay alike for seconds: the mean of each anchor over `block_s` counts as one.
/// Corrections that every range has alike gain nothing here: the solver's own bias does the same.
///
/// raw, corrected  solutions of the flight without and with; corrected_flight: what the latter was made of
/// returns         not shown where fewer than 8 blocks have residuals in both
CorrectionWorth correction_worth(const FlightSolution& raw, const FlightSolution& corrected,
                                 const FlightData& corrected_flight, double block_s = 15);

}  // namespace anchord
