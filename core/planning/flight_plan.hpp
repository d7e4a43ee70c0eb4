#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/planning/bounds.hpp"
#include "core/planning/walls.hpp"
#include "core/types/plan.hpp"

namespace anchord::planning {

/// Waypoints are set no nearer to the fence: what the aircraft drifts in a gust.
inline constexpr double k_fence_margin_m = 1;

struct FlightPlanInput {
  Polygon outline;  ///< of the building, ENU metres
  double building_height_m = 6;
  std::vector<Polygon> no_fly;
  Polygon fence;  ///< empty: none
  Walls walls{};  ///< accepted ones, in the same metres
};

struct FlightPlanOptions {
  double keep_out_m = 4;                ///< from the outline and from no-fly areas
  std::vector<double> ring_m = {0, 6};  ///< rings of candidates, beyond keep_out_m
  std::vector<double> heights_m;        ///< above ground; empty: 2 m, mid-height and 1 m above the
                                        ///< roof: from further up every ray goes through it
  double spacing_m = 3;                 ///< of candidates along a ring
  double anchor_spacing_m = 5;          ///< of the anchors assumed inside, at most `max_anchors` of them
  int max_anchors = 80;
  double floor_m = 3;  ///< assumed anchors hang 2.5 m above each floor
  double max_range_m = 60;
  Rule rule = Rule::a_optimal;  ///< a_optimal: mean over the assumed anchors; d_optimal: mean log volume
  int min_points = 8;           ///< a flight with fewer cannot tell bias, height and mirror apart
  int max_points = 60;
  /// Stops adding once a point lowers the mean expected squared error by less than this share.
  double min_gain = 0.02;
  int ranges_per_point = 20;    ///< n samples of the dwell
  double range_sigma_m = 0.15;  ///< through a facade: between 0.05 (line of sight) and 0.23 (NLOS)
  double point_sigma_m =
      0.05;  ///< common to all ranges of one point: RTK and multipath do not average out there
  double prior_sigma_m = 30;
  double bias_sigma_m = 0.3;   ///< constant excess per anchor, estimated too
  double wall_excess_m = 0.2;  ///< of one wall at right angles, unknown: 22 cm of brick give 0.24, glass 0.02
  double roof_walls = 2;       ///< a roof counts as so many walls: a slab is thicker and denser
  double speed_mps = 2;
  double dwell_s = 4;

  /// errors: invalid_argument naming the field
  Result<void> check() const;
};

struct Waypoint {
  Eigen::Vector3d point_m{0, 0, 0};  ///< ENU; height above ground
  bool measure{true};                ///< false: only on the way, round a corner
  double heading_rad{};              ///< towards the middle of the building, clockwise from north
};

struct FlightPlan {
  std::vector<Waypoint> waypoints;  ///< in flying order, closed: the first follows the last
  std::size_t n_measure{};
  std::size_t n_candidates{};
  std::size_t n_unreachable{};                     ///< places more, to which no permitted path leads
  std::vector<Eigen::Vector3d> assumed_anchors_m;  ///< those that can be ranged from outside
  std::size_t n_out_of_range{};                    ///< the others
  std::vector<double> predicted_sigma_m;  ///< per assumed anchor: root of the summed variance of its position
  double rms_m{}, worst_m{};
  double length_m{}, duration_s{};
  std::string reason;  ///< why it stopped adding points
};

/// Waypoints of a whole flight from the outline of the building alone, so that none is set by hand (chapter
/// 9): greedy choice among candidates on rings round the outline, then exchange of single points until none
/// helps, then an order round the building with transit points where the straight way would cut a corner.
///
/// errors   invalid_argument (outline of fewer than three corners or without area, options), not_found
/// (nowhere to
///          fly: fence and no-fly leave no candidate; or two points no legal way joins)
/// threads  pure; deterministic
Result<FlightPlan> plan_flight(const FlightPlanInput& input, const FlightPlanOptions& options);

/// Whether enough of the flight could range an anchor there: four points at least.
bool in_range(const Eigen::Vector3d& anchor, const std::vector<Eigen::Vector3d>& points_m,
              double max_range_m);

/// Says of `FlightPlan::n_unreachable` what it is.
std::string left_out_text(std::size_t n_unreachable);

/// Points at exactly `distance_m` outside a polygon, in order round it, `spacing_m` apart.
std::vector<Eigen::Vector2d> ring_around(const Polygon& polygon, double distance_m, double spacing_m);

}  // namespace anchord::planning
