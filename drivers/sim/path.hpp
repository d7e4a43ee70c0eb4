#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <vector>

namespace anchord::sim {

/// Where the simulated aircraft's GNSS antenna is and how the aircraft is turned; ENU metres.
struct Pose {
  Eigen::Vector3d enu_m{0, 0, 0};
  Eigen::Vector3d velocity_mps{0, 0, 0};
  double heading_rad{};  ///< of the nose, clockwise from north
  /// Rotation from body (forward, left, up) to ENU: level flight.
  Eigen::Quaterniond enu_from_body() const;
};

/// Whatever moves the aircraft: a path of a scenario, live commands, another simulator.
using Whereabouts = std::function<Pose(double time_s)>;

struct PathPoint {
  Eigen::Vector3d enu_m{0, 0, 0};
  double hold_s{};                      ///< stays there
  std::optional<double> heading_rad{};  ///< while flying there and holding; absent: the nose points along
  bool turn{};                          ///< while holding, one full turn to the right (8.3.5)
};

/// Straight legs at one speed. Pure: the same time gives the same pose.
class FlightPath {
 public:
  /// points  at least one; speed > 0. With `loop` the path closes and repeats, else it ends in a hover.
  FlightPath(std::vector<PathPoint> points, double speed_mps, bool loop);
  Pose at(double time_s) const;
  double duration_s() const { return end_s_; }  ///< of one round

 private:
  struct Leg {
    double start_s{}, fly_s{}, hold_s{};
    Eigen::Vector3d from_m, to_m;
    double heading_rad{};
    bool turn{};
  };
  std::vector<Leg> legs_;
  bool loop_;
  double end_s_{};
};

/// Rings round a rectangle (x 0..length, y 0..width) at a clearance, one per height, corners cut at the same
/// clearance; the nose points along.
std::vector<PathPoint> ring_path(const Eigen::Vector2d& corner_m, const Eigen::Vector2d& opposite_m,
                                 double clearance_m, const std::vector<double>& heights_m);

/// An aircraft under live commands: flies straight towards its goal at a speed, then hovers. Calls must come
/// with rising time; not thread-safe.
class LiveMover {
 public:
  LiveMover(const Pose& start, double speed_mps)
      : pose_(start), goal_m_(start.enu_m), speed_mps_(speed_mps) {}
  void go_to(const Eigen::Vector3d& enu_m, std::optional<double> heading_rad);
  void set_speed(double speed_mps) { speed_mps_ = speed_mps; }
  Pose at(double time_s);

 private:
  Pose pose_;
  Eigen::Vector3d goal_m_;
  double speed_mps_, last_s_{};
};

}  // namespace anchord::sim
