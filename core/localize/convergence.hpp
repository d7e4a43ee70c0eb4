#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/flight_options.hpp"
#include "core/types/estimate.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {

/// One range of an iteration and what was made of it.
struct CorrectedRange {
  Eigen::Vector3d tag_m{0, 0, 0};  ///< antenna, ENU or local
  double distance_m{};             ///< as received
  double corrected_m{};
};

/// One anchor after the first part of a flight (an iteration of Fig 8.10 and 8.11).
struct ConvergenceStep {
  double share{};                                ///< of the flight's ranges flown so far, (0, 1]
  std::size_t n_ranges{};                        ///< of this anchor, so far
  std::optional<Eigen::Vector3d> raw_m{};        ///< least squares on the ranges as received
  std::optional<Eigen::Vector3d> corrected_m{};  ///< with bias, lag and robust weights
  double h95_m{};                                ///< claimed, of the corrected one
  Verdict verdict{Verdict::too_few};
  std::optional<CorrectedRange> middle{};  ///< of this iteration's ranges the one of median error
  std::size_t n_los{}, n_nlos{};           ///< of this iteration's ranges, as a model predicted
};
using Convergence = std::map<NetworkId, std::vector<ConvergenceStep>>;

/// How the answer came about: the flight cut after each of `steps` equal numbers of ranges and solved anew,
/// raw (no bias, no loss) and corrected. Steps too short to be solved are absent. Costs 2 x steps solves.
/// steps    1 to 50, else invalid_argument;  errors of the options;  canceled
/// threads  pure
Result<Convergence> convergence_of(const FlightData& flight, const FlightOptions& options, int steps);

/// A flight without what models made of its ranges. flight  its ranges are kept as rows
FlightData as_received(FlightData flight);

}  // namespace anchord
