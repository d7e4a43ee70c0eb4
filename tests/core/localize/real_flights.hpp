#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/localize/flight_solver.hpp"

namespace anchord::testing {

/// How a flight is solved, from the least to everything.
enum class Variant : std::uint8_t {
  plain,    ///< least squares of the ranges as they came: no loss, no bias, no lag
  robust,   ///< the same with the redescending loss
  single,   ///< the whole model, from this flight alone
  profile,  ///< the whole model, with the profile of the kit's other flights (leave one flight out)
};
const char* word(Variant variant);

/// One anchor of one flight against the truth.
struct AnchorError {
  std::string flight;
  AnchorSolution solution;
  bool flat{false};  ///< the truth has no height
  double error_h_m{}, error_3d_m{};
  double claimed_3d_m{};     ///< largest semi-axis of the 95 % region
  double claimed_sigma_m{};  ///< root of the trace of the covariance, in the plane where there is no height
  bool inside{false};

  bool answered() const { return solution.determined != Determined::none && solution.estimate.best; }
  double error_m() const { return flat ? error_h_m : error_3d_m; }
  /// Claimed 95 % over the actual error, in the plane where there is no height.
  double ratio() const;
  /// Root of the trace over the error: 1.1 in the median of an honest Gaussian in space, 1.2 in the plane.
  double sigma_ratio() const;
};

/// A set of ../shared/data: its flights, read once.
struct FlightSet {
  std::string name;
  std::vector<std::filesystem::path> folders;
  std::vector<FlightData> flights;
};
FlightSet read_set(const std::string& name);
std::vector<FlightSolution> solve_set(const FlightSet& set, Variant variant);
/// Anchors with a surveyed place, of flight `index` of the set.
std::vector<AnchorError> assess(const FlightSet& set, std::size_t index, const FlightSolution& solution);

/// What several anchors come to.
struct Summary {
  int n{0}, inside{0}, undetermined{0};
  double mean_h_m{0}, mean_m{0}, max_m{0};
  double median_h95_m{0}, median_ratio{0}, median_sigma_ratio{0};
  int acceptable{0}, acceptable_outside{0};
  double inside_share() const { return n > 0 ? static_cast<double>(inside) / n : 0.0; }
};
Summary summary(const std::vector<AnchorError>& anchors);

}  // namespace anchord::testing
