#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/ports/drone.hpp"
#include "drivers/drone/dialect.hpp"
#include "drivers/drone/twin_watch.hpp"
#include "drivers/mavlink/message.hpp"

namespace anchord::drone {

/// What the autopilot tells of itself, each stream with its age. A stream that is older than 3 s is asked for
/// again (an autopilot that was restarted sends nothing but its heartbeat), one at a time so that the answers
/// can be told apart; one that is refused is shown, and asked for as part of its group where the autopilot
/// has groups; older than 5 s it is stale. Parameters are asked for one by one. A GLOBAL_POSITION_INT that
/// says no place, or none on earth, is no position: the last one ages.
class Telemetry {
 public:
  Telemetry();
  void receive(const mavlink::Message& m, Autopilot autopilot, double now_s);
  /// What to ask for now: COMMAND_LONG 511, REQUEST_DATA_STREAM or PARAM_REQUEST_READ, not addressed yet.
  std::optional<mavlink::Message> question(Autopilot autopilot, double now_s);
  void answer(std::int64_t result);  ///< to the newest 511
  void ask_parameters(const std::vector<std::string>& names);
  /// Another life of the autopilot, or another one in its place: what was said before is no longer so.
  void restarted();
  /// How often that was.
  int restarts() const { return restarts_; }

  void fill(DroneStatus& out, double now_s) const;
  const DroneStatus& newest() const { return status_; }
  bool fresh(std::string_view stream, double now_s, double within_s) const;
  bool has_position(double now_s, double within_s) const { return now_s - position_s_ <= within_s; }
  bool two_autopilots(double now_s) const { return twins_.two(now_s); }
  std::optional<double> home_msl_m() const;
  bool armed() const { return status_.armed; }
  bool in_air(double now_s) const;
  /// The newest warning of the autopilot, and when it came.
  const std::string& warning() const { return warning_; }
  double warning_s() const { return warning_s_; }

 private:
  struct Stream {
    int id{};
    std::string_view name;
    double interval_s{};
    bool watched{false};  ///< flights are judged by it
    double last_seen_s{-1e9}, asked_s{-1e9};
    int asked{0};
    std::int64_t result{0};  ///< MAV_RESULT of the newest answer
    bool by_group{false};    ///< asked for by its group since it was refused
  };
  struct Parameter {
    std::optional<double> value{};
    double asked_s{-1e9};
    int asked{0};
  };

  void receive_status_text(const mavlink::Message& m, double now_s);
  void receive_position(const mavlink::Message& m, double now_s);
  void receive_battery(const mavlink::Message& m, double now_s);
  void receive_parameter(const mavlink::Message& m, Autopilot autopilot);

  DroneStatus status_;
  std::array<Stream, 7> streams_;
  std::map<std::string, Parameter> parameters_;
  std::optional<double> first_s_;
  double position_s_{-1e9}, battery_s_{-1e9}, question_s_{-1e9}, warning_s_{-1e9};
  std::optional<std::size_t> open_;  ///< stream whose question has no answer yet
  std::int64_t boot_ms_{0}, landed_{0};
  int restarts_{0};
  std::string warning_;
  TwinWatch twins_;
};

}  // namespace anchord::drone
