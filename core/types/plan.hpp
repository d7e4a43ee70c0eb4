#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/position.hpp"
#include "core/types/wall.hpp"

namespace anchord::planning {

/// What makes a measuring point, or the points of a whole flight, good. All values are "lower is better".
enum class Rule : std::uint8_t {
  dissertation,  ///< trace (M^T M)^-1 of all measured points and the candidate, eq 8.5; of single points only
  a_optimal,     ///< trace of the expected position covariance, m^2
  d_optimal,     ///< log det of it: volume of the error ellipsoid, blind to units and axes
};
inline constexpr auto k_rule_words = enum_table<Rule>(
    {{"dissertation", Rule::dissertation}, {"a_optimal", Rule::a_optimal}, {"d_optimal", Rule::d_optimal}});
constexpr std::string_view to_string(Rule rule) { return k_rule_words.word(rule); }

/// How several anchors make one value.
enum class Combine : std::uint8_t {
  worst,  ///< the anchor that is worst off decides
  mean,
  weighted,  ///< mean, weighted by how far each is from its target accuracy
};
inline constexpr auto k_combine_words = enum_table<Combine>(
    {{"worst", Combine::worst}, {"mean", Combine::mean}, {"weighted", Combine::weighted}});
constexpr std::string_view to_string(Combine how) { return k_combine_words.word(how); }

}  // namespace anchord::planning

namespace anchord {

using PlanId = Id<struct PlanTag>;

struct LonLat {
  double lon_deg{}, lat_deg{};
  bool operator==(const LonLat&) const = default;
};
/// Corners in order, not closed; empty: there is none.
using GeoPolygon = std::vector<LonLat>;

struct PlanWaypoint {
  LonLat at;
  double height_m{};                    ///< above the ground of the plan's origin
  std::optional<double> heading_deg{};  ///< clockwise from north; absent: towards the building
  std::optional<double> dwell_s{};      ///< absent: the plan's
  bool measure{true};                   ///< false: only on the way
  bool turn{false};                     ///< 360 degree turn here, for anchors without a bearing
  bool height_search{false};
};

/// A wall of a floor plan; heights above the ground.
struct GeoWall {
  LonLat from, to;
  double bottom_m{}, top_m{};
  double thickness_m{0.1};
  WallMaterial material{WallMaterial::unknown};
};

/// What people accepted of the floor plans of a site.
struct SiteStructure {
  std::vector<GeoWall> walls;
  std::vector<GeoPolygon> outlines;  ///< of its buildings, floor by floor: nothing is flown inside
  std::uint64_t version{0};          ///< changes with any of them
};

/// Grid, rules and limits of a flight; the defaults fly without a look at them.
struct PlanSettings {
  double keep_out_m = 4;  ///< from the outline and from no-fly areas
  double min_height_m = 1.5, max_height_m = 30;
  double speed_mps = 2;
  double dwell_s = 4;
  int samples = 20;  ///< ranges wanted of each anchor at a point
  int k = 3;         ///< steps towards the next waypoint where no anchor is in range, eq 8.6
  bool turn = true, height_search = true;  ///< for anchors ranged first, where the waypoint allows it
  double grid_step_m = 3, grid_step_up_m = 2;
  int grid_reach = 2, grid_reach_up = 1;
  planning::Rule rule = planning::Rule::a_optimal;
  planning::Combine combine = planning::Combine::weighted;
  int min_iterations = 4, max_iterations = 40;  ///< 8.4.4, per anchor
  double target_sigma_m = 0.05;
  std::optional<double> target_gdop{};  ///< conventional: the root
  std::optional<double> max_flight_s{};
  double min_battery = 0.3;   ///< share at which the aircraft goes home
  double endurance_s = 1200;  ///< of the aircraft on a full battery
};

/// What the operator wants flown: outline, areas, waypoints, settings. `version` is its revision.
struct Plan {
  PlanId id{};
  std::string name;
  std::optional<SiteId> site{};
  std::optional<Wgs84> origin{};  ///< ground; absent: the middle of the outline or of the waypoints, height 0
  GeoPolygon outline;             ///< of the building
  double building_height_m = 6;
  std::vector<GeoPolygon> no_fly;
  GeoPolygon fence;
  PlanSettings settings{};
  std::vector<NetworkId> expected_anchors;
  std::map<NetworkId, double>
      anchor_target_sigma_m;  ///< of those that are not to reach settings.target_sigma_m
  std::vector<PlanWaypoint> waypoints;
  /// Of its site, as it is now: joined where a plan is checked, generated or flown, never kept with it.
  std::shared_ptr<const SiteStructure> structure{};
  UtcTime created{}, changed{};
  std::uint64_t version{1};
};

}  // namespace anchord
