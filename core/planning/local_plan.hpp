#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/planning/bounds.hpp"
#include "core/planning/flight_plan.hpp"
#include "core/types/plan.hpp"

namespace anchord::planning {

/// A plan in metres: east, north, up of its origin on the ground.
struct LocalPlan {
  Wgs84 origin;
  Polygon outline;
  std::vector<Polygon> no_fly;
  Polygon fence;
  std::vector<Eigen::Vector3d> waypoints_m;
  std::vector<Polygon> buildings;  ///< outlines of accepted floor plans that no other one covers
  Walls walls;                     ///< of them
};

/// Where 0, 0, 0 of a plan is: its origin, else the middle of its outline, else of its waypoints.
/// errors  invalid_argument: neither
Result<Wgs84> plan_origin(const Plan& plan);
Result<LocalPlan> local_plan(const Plan& plan);

/// Where the aircraft may be by this plan: the outline is a no-fly area like the drawn ones, and so are the
/// outlines of accepted floor plans.
Bounds flight_bounds(const LocalPlan& plan, const PlanSettings& settings);

enum class Severity : std::uint8_t { error, warning };
inline constexpr auto k_severity_words =
    enum_table<Severity>({{"error", Severity::error}, {"warning", Severity::warning}});
struct PlanIssue {
  Severity severity{};
  std::string code;     ///< stable word
  std::string pointer;  ///< JSON pointer into the plan
  std::string text;     ///< for the operator, with the numbers
};

/// Forecast of a flight's time, s.
struct FlightTime {
  double low_s{}, expected_s{}, high_s{};
};

/// What a look at the plan finds, and what the flight would take and bring.
struct PlanCheck {
  std::vector<PlanIssue> issues;
  double length_m{};
  FlightTime time;
  std::size_t n_measure{};
  /// Of anchors assumed 5 m apart inside the outline, as far as four measuring points are in range; empty
  /// without outline or measuring points.
  std::vector<Eigen::Vector3d> assumed_anchors_m;
  std::size_t n_out_of_range{};  ///< the others
  std::vector<double> predicted_sigma_m;
  /// Of the measuring points within reach, seen from each assumed anchor; root of the trace. Absent: fewer
  /// than three, or all in one plane with it.
  std::vector<std::optional<double>> predicted_gdop;
  double rms_m{}, worst_m{};
  bool flyable() const;  ///< no error among the issues
};

/// Every waypoint and every straight way between two against fence, no-fly areas, outline and height band;
/// the flight's time against its limit.
/// errors  invalid_argument as plan_origin()
Result<PlanCheck> check_plan(const Plan& plan);

/// The plan with its waypoints replaced by those of a flight that was planned in metres round `origin`.
Plan with_waypoints(Plan plan, const FlightPlan& flight, const Wgs84& origin);

struct GeneratedPlan {
  Plan plan;
  PlanCheck check;  ///< of it; places that no permitted path leads to are among its issues
};
/// The plan with its waypoints replaced by those of plan_flight(), and a look at it.
/// errors  as plan_flight(), and invalid_argument without an outline
Result<GeneratedPlan> generate_waypoints(const Plan& plan);

}  // namespace anchord::planning
