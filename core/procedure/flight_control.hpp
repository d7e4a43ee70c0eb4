#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/geo/enu.hpp"
#include "core/ports/drone.hpp"
#include "core/procedure/flight_engine.hpp"

namespace anchord::procedure {

/// One flight and its aircraft: the engine's orders become commands, telemetry becomes what the engine sees.
///
/// An order is sent in its moment or not at all: while the pilot has the aircraft it is dropped and told.
/// After a silence or a restart of the server nothing is sent again; what the step wants is decided anew, and
/// only when the aircraft still is in a mode of ours. Targets are shifted by what the rover says of the
/// autopilot's position, and corrected once a second.
///
/// Driven by calls alone: no clock, no thread. Not thread-safe. A new flight is a new object.
class FlightControl {
 public:
  /// `drone` null: flown by hand. Metres of the setup's origin, whose ground is at height 0 of `frame`.
  FlightControl(FlightSetup setup, EnuFrame frame, Drone* drone);
  /// Goes on with a stored flight after a restart.
  FlightControl(FlightSetup setup, EnuFrame frame, Drone* drone, const State& stored, double now_s);

  /// What became of an order of the procedure.
  struct Dispatch {
    Command::Kind kind{};
    std::uint64_t number{};  ///< of the aircraft's report; 0: not sent
    std::string not_sent;    ///< why not; empty and number 0: shown to the pilot
  };

  void fix(double now_s, const Eigen::Vector3d& enu_m, FixClass fix);
  bool start(double now_s, const std::string& who);
  /// hold, resume, skip, return_home, land of an operator. Hold and land are always sent. Empty: done; else
  /// why not.
  std::string command(double now_s, Trigger trigger, const std::string& who);
  /// Hold, and nothing more: the aircraft is the pilot's.
  std::uint64_t abort();
  /// At least twice a second. `at_hand` false: the estimates could not be read, decisions wait, safety does
  /// not.
  void round(double now_s, std::span<const Estimate> estimates, bool at_hand = true);
  /// FlightEngine::change_plan(), and what follows from it for the aircraft.
  void change_plan(double now_s, FlightSetup setup, std::size_t waypoint, const std::string& why) {
    engine_.change_plan(now_s, std::move(setup), waypoint, why);
    dispatch();
  }
  void by_hand(double now_s, const VehicleView& view) { engine_.vehicle(now_s, view); }
  void report(double now_s, const CommandReport& report);

  std::vector<Dispatch> take_dispatched() { return std::exchange(dispatched_, {}); }
  FlightEngine& engine() { return engine_; }
  const FlightEngine& engine() const { return engine_; }
  bool taken_over() const { return taken_over_; }
  /// Rover minus autopilot, smoothed; none before both were heard.
  const std::optional<Eigen::Vector3d>& shift_m() const { return shift_m_; }

 private:
  void update_vehicle(double now_s, const DroneStatus& d);
  void follow_link(double now_s, const DroneStatus& d);
  void smooth(double now_s, const Eigen::Vector3d& difference_m, double speed_mps);
  void dispatch();
  std::uint64_t send(const Command& order);
  struct Aim {
    double lat_deg{}, lon_deg{}, height_m{};
  };
  Aim aim(const Eigen::Vector3d& point_m, const DroneStatus& d) const;

  EnuFrame frame_;
  Drone* drone_;
  Eigen::Vector3d home_m_;
  FlightEngine engine_;
  bool armed_{false}, in_air_{false};  ///< as the procedure was told
  bool taken_over_{false}, explained_{false}, silent_{false}, adopts_{false}, over_{false}, repeats_{false};
  std::optional<Eigen::Vector3d> fix_m_, autopilot_m_, shift_m_;
  std::optional<double> fix_s_, smoothed_s_, sea_level_m_, steered_s_, sent_s_, cells_, cell_v_, cell_s_;
  std::uint64_t last_target_{0}, take_off_{0};
  std::vector<Dispatch> dispatched_;
};

}  // namespace anchord::procedure
