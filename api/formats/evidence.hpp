#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/localize/convergence.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {

/// What one flight said, thinned to what a page can show.
struct FlightEvidence {
  std::string name, kit;
  SharedSolution shared;
  std::size_t n_fixes{}, n_ranges{}, n_used{};
  std::map<std::string, std::size_t> refused;
  std::vector<std::string> notes;
  std::vector<Eigen::Vector2d> track_m;  ///< east, north
  std::map<NetworkId, std::vector<RangeResidual>> residuals;
  bool observations{true};  ///< tag_m, corrected_m and sigma_m of the residuals were kept (not before 0.2)
};

/// Everything behind a calibration that its positions do not carry.
struct Evidence {
  std::vector<FlightEvidence> flights;
  Convergence course;
};

/// At most 400 track points and 500 residuals an anchor, evenly taken; rejected ranges are preferred over
/// used ones, for they are what a reader looks for.
FlightEvidence evidence_of(const FlightData& flight, const FlightSolution& solution,
                           const std::optional<Wgs84>& origin);

/// As kept with a calibration (compact arrays; docs/formats.md).
std::string evidence_json(const Evidence& evidence);
/// errors: bad_frame for a text that evidence_json did not write
Result<Evidence> parse_evidence(std::string_view json);

}  // namespace anchord
