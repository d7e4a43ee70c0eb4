#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "core/planning/bounds.hpp"
#include "core/planning/candidates.hpp"
#include "core/planning/grid.hpp"
#include "core/planning/walls.hpp"
#include "core/types/plan.hpp"

namespace anchord::planning {

/// Where an anchor may be, and how likely. A mirror pair is two of these.
struct Place {
  Eigen::Vector3d position_m{0, 0, 0};
  double probability{1};
};

struct PlannedAnchor {
  std::string name;
  std::vector<Place> places;             ///< one, or the mirror candidates too
  std::vector<std::size_t> measured_at;  ///< indices of `visited` where it was ranged
  std::optional<Eigen::Matrix3d>
      covariance_m2{};  ///< of the estimator; then `measured_at` is not counted again
  double weight{1};
  double target_m{0.05};  ///< wanted position sigma, for Combine::weighted
};

struct NextPointInput {
  std::vector<Eigen::Vector3d>
      visited;  ///< in order; the last is where the aircraft is unless `current` says so
  std::optional<Eigen::Vector3d> current{};
  std::vector<Eigen::Vector3d> unreachable;  ///< tried and given up (8.3.9, 8.3.10)
  std::vector<PlannedAnchor> anchors;
  Bounds bounds;
  Walls walls{};  ///< what ranges go through; nothing is flown by them
};

struct NextPointOptions {
  int dims = 3;  ///< 2: heights are ignored in the geometry, as in 8.5
  Rule rule = Rule::dissertation;
  Combine combine = Combine::worst;
  GridOptions grid;
  std::optional<double> max_range_m{};  ///< beyond it no range is expected
  /// A point counts as visited within this share of a step: real flights do not stop exactly on the grid.
  double visited_share = 0.5;

  // For a_optimal and d_optimal. Variances of the dissertation (7.2), as standard deviations.
  double los_sigma_m = 0.049;      ///< sqrt(2401 mm^2)
  double nlos_sigma_m = 0.2336;    ///< sqrt(54550 mm^2)
  double position_sigma_m = 0.02;  ///< RTK, sqrt(400 mm^2)
  double prior_sigma_m = 100;      ///< of an anchor nobody has measured: weak, only keeps the matrix regular
  bool bias_column = false;        ///< a constant excess on every range of the anchor is estimated too
  double bias_sigma_m = 0.3;
  bool flight_time_cost = false;  ///< gain per second instead of gain
  double speed_mps = 2.0;
  double dwell_s = 2.0;

  /// errors: invalid_argument naming the field
  Result<void> check() const;
};

/// Where next, what it should bring, and what was refused.
struct Decision {
  std::optional<std::size_t> chosen{};  ///< index into candidates; absent: nowhere to go from here
  double value_before{};                ///< +infinity while singular
  std::string reason;                   ///< in words, for the operator
  Candidates candidates;
};

/// Best next point by the rule (8.4.3). Visited, unreachable and forbidden points keep their value but cannot
/// win; equal values (1e-9 relative) go to the first in the order of the grid.
///
/// errors   invalid_argument (no anchor, no position, indices or numbers that make no sense)
/// threads  pure
Result<Decision> next_point(const NextPointInput& input, const NextPointOptions& options);

}  // namespace anchord::planning
