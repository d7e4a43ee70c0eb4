#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/planning/flight_plan.hpp"
#include "core/planning/walls.hpp"

namespace anchord::planning {

inline constexpr double k_furthest_corner_m = 2000;  ///< of an outline from the origin: no building is larger

/// How one point sees one anchor: the row of the linear model and what the building does to it.
struct Sight {
  Eigen::Vector4d row{0, 0, 0, 0};  ///< unit vector and 1 for the bias; zero: no range
  double variance_m2{1};            ///< of the mean of the ranges of the point
  double slant{0};  ///< walls on the way, each by the inverse cosine: excess in units of one unknown wall
};

/// The outline as upright walls of unknown make under a roof, and what is known of the walls. Where an
/// accepted wall is met within 0.6 m of the outline, it is the facade there: tracing is good to 0.1 m, and
/// the middle of a wall lies inside its outline by half its thickness.
struct Building {
  Polygon outline;
  double height_m{};
  Walls walls{};
};

/// Expected error of position and bias of many assumed anchors, under a set of measuring points that changes.
///
/// Beside the covariance it follows what the walls do: their excess grows with the slant of the ray, the
/// solver's constant bias cannot take that up, and it shifts the position the same way in every flight. The
/// shift of one metre of excess is an estimate itself, of "ranges" that are the slants, so that it follows by
/// the same rank-1 update. Expected squared error = variance + (wall excess x shift)^2: even and upright
/// sights win over near and slanted ones.
class Design {
 public:
  Design(std::span<const Eigen::Vector3d> anchors, const FlightPlanOptions& options,
         const Building& building = {});

  /// Of a point, anchor by anchor; to be computed once for a candidate.
  std::vector<Sight> sights(const Eigen::Vector3d& point) const;
  void add(std::span<const Sight> point) { update(point, 1); }
  void remove(std::span<const Sight> point) { update(point, -1); }  ///< one that was added
  double value_with(std::span<const Sight> point) const;

  void add(const Eigen::Vector3d& point) { add(sights(point)); }
  void remove(const Eigen::Vector3d& point) { remove(sights(point)); }
  double value_with(const Eigen::Vector3d& point) const { return value_with(sights(point)); }
  /// Of the criterion, summed over the anchors; lower is better.
  double value() const;
  double mean_square_m2() const;         ///< expected squared error, mean over the anchors
  std::vector<double> sigmas_m() const;  ///< root of it, anchor by anchor

 private:
  struct ErrorModel {
    Eigen::Matrix4d covariance;
    Eigen::Vector4d shift{0, 0, 0, 0};  ///< of the answer by one unit of slant excess
  };
  Sight sight(const Eigen::Vector3d& point, const Eigen::Vector3d& anchor) const;
  void update(std::span<const Sight> point, double sign);
  double value_of(const ErrorModel& error_model) const;
  double square_m2(const ErrorModel& error_model) const;

  std::vector<Eigen::Vector3d> anchors_;
  std::vector<ErrorModel> error_models_;
  FlightPlanOptions options_;
  Building building_;
};

}  // namespace anchord::planning
