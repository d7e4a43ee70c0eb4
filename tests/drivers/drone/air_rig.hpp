#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/procedure/flight_control.hpp"
#include "drivers/drone/session.hpp"
#include "drivers/sim/autopilot.hpp"

namespace anchord::test {

/// The real session and procedure against the simulated autopilot in virtual time: no socket, no thread, no
/// sleep. A hall of 30 x 20 m with a fence round it, two waypoints, two anchors that answer, a rover.
class AirRig {
 public:
  static constexpr std::int64_t k_unix_us = 1'777'888'800'000'000;
  static constexpr double k_step_s = 0.05;

  /// A command on the wire: heartbeats, questions for telemetry and parameters are none.
  struct Wire {
    double at_s{};
    int command{};         ///< MAV_CMD; 86 for a position target
    std::uint32_t mode{};  ///< of 176
    double p1{};
    std::int64_t again{};                       ///< confirmation
    std::optional<Eigen::Vector3d> target_m{};  ///< of 86 and 192, in truth
  };

  explicit AirRig(sim::AutopilotOptions options = {}, Eigen::Vector3d home_m = {-9, -9, 0})
      : frame({51.0231, 3.7131, 55.5}), autopilot(with_home(std::move(options), home_m)), home(home_m) {}

  static procedure::FlightSetup setup(const Eigen::Vector3d& home_m) {
    procedure::FlightSetup s;
    s.settings.waypoints = {{{-8, -5, 4}, 0.5, true, true, false, 1},
                            {{-8, 12, 6}, 0.5, true, false, false, 1}};
    s.settings.ranging_s = 4;
    s.settings.take_off_m = 4;
    s.settings.min_height_m = 2;
    s.settings.max_height_m = 20;
    auto& bounds = s.limits.bounds;
    bounds.fence = {{-30, -30}, {60, -30}, {60, 50}, {-30, 50}};
    bounds.no_fly = {{{0, 0}, {30, 0}, {30, 20}, {0, 20}}};
    bounds.keep_out_m = 4;
    bounds.min_height_m = 2;
    bounds.max_height_m = 20;
    s.limits.home_m = home_m;
    s.middle_m = {15, 10, 3};
    s.samples = 5;
    s.planner.grid = {4, 3, 1, 0};
    return s;
  }

  bool flying() const { return control && !aborted && !done(); }
  bool done() const { return control && control->engine().state().step == procedure::Step::done; }
  procedure::Step step_now() const {
    return control ? control->engine().state().step : procedure::Step::ready;
  }
  std::string reason() const { return control ? control->engine().state().reason : ""; }

  std::function<void(procedure::FlightSetup&)> other;  ///< what this flight has otherwise
  bool start() {
    if (flying() || session->status().in_air || !session->status().connected) return false;
    auto flight = setup(rover());
    if (other) other(flight);
    control = std::make_unique<procedure::FlightControl>(std::move(flight), frame, session.get());
    aborted = false;
    control->fix(now, rover(), FixClass::rtk_fixed);
    return control->start(now, "operator");
  }
  /// As FlightService does it.
  std::string act(const std::string& action) {
    using procedure::Trigger;
    if (action == "start") return start() ? "" : "not now";
    if (action == "disarm" || ((action == "hold" || action == "land") && !flying())) {
      if (flying() && control->taken_over()) session->take_back();
      action == "hold" ? session->hold() : action == "land" ? session->land() : session->disarm();
      collect();
      return "";
    }
    if (!flying()) return "this mission is not being flown";
    std::string why;
    if (action == "abort")
      control->abort(), aborted = true;
    else
      why = control->command(now,
                             action == "hold"     ? Trigger::hold
                             : action == "resume" ? Trigger::resume
                             : action == "skip"   ? Trigger::skip
                             : action == "land"   ? Trigger::land
                                                  : Trigger::return_home,
                             "operator");
    collect();
    return why;
  }
  /// Killed without a farewell, back after a while with what was stored.
  void restart_server(double away_s) {
    std::optional<procedure::State> stored;
    if (flying()) stored = control->engine().state();
    control.reset();
    session.reset();
    for (const double end = now + away_s; now < end;) {
      now += k_step_s;
      autopilot.advance(now);
      (void)autopilot.take_bytes();
    }
    session = std::make_unique<drone::Session>();
    aborted = false;
    if (stored && stored->step != procedure::Step::ready)
      control = std::make_unique<procedure::FlightControl>(setup(home), frame, session.get(), *stored, now);
  }

  Eigen::Vector3d rover() const {
    const Eigen::Vector3d at = autopilot.vehicle().position_m();
    return at;
  }

  void step() {
    now += k_step_s;
    const auto unix_us = k_unix_us + static_cast<std::int64_t>(now * 1e6);
    autopilot.advance(now);
    const auto in = autopilot.take_bytes();
    if (!link_down) {
      receive(in);
      session->feed(now, unix_us, in);
    }
    session->tick(now, unix_us);
    ++n;
    if (n % 2 == 0) second_half();
    collect();
  }
  void run(double seconds) {
    for (const double end = now + seconds - 1e-9; now < end;) step();
  }
  template <class Done>
  bool run_until(Done when, double seconds) {
    for (const double end = now + seconds; now < end;) {
      step();
      if (when()) return true;
    }
    return when();
  }
  bool until_step(procedure::Step wanted, double seconds) {
    return run_until([&] { return step_now() == wanted; }, seconds);
  }
  bool fly() {
    run(7);
    return start() && until_step(procedure::Step::go_to_waypoint, 60);
  }
  CommandState fate(const std::string& what) const {
    CommandState out{};
    for (const auto& r : reports) {
      if (r.what == what) out = r.state;
    }
    return out;
  }
  std::string words(const std::string& what) const {
    std::string out;
    for (const auto& r : reports) {
      if (r.what == what) out = r.text;
    }
    return out;
  }
  std::vector<Wire> since(double at_s) const {
    std::vector<Wire> out;
    for (const auto& w : wire) {
      if (w.at_s > at_s) out.push_back(w);
    }
    return out;
  }

  EnuFrame frame;
  sim::AutopilotSim autopilot;
  Eigen::Vector3d home;
  std::unique_ptr<drone::Session> session{std::make_unique<drone::Session>()};
  std::unique_ptr<procedure::FlightControl> control;
  std::vector<CommandReport> reports;
  std::vector<procedure::Event> events;
  std::vector<Wire> wire;
  double now{0}, lowest_m{1e9};
  std::uint64_t n{0};
  bool link_down{false}, rtk_lost{false}, aborted{false}, silent_anchors{false};
  std::optional<std::uint32_t> shown_mode;  ///< of the newest heartbeat that reached the server
  double shown_s{0};

 private:
  static sim::AutopilotOptions with_home(sim::AutopilotOptions o, const Eigen::Vector3d& home_m) {
    o.home_m = home_m;
    o.vehicle.ground_m = home_m.z();
    o.ready_s = std::min(o.ready_s, 5.0);
    return o;
  }
  void second_half() {
    for (auto& r : session->take_reports()) {
      if (control && !aborted) control->report(now, r);
      reports.push_back(std::move(r));
    }
    if (!control || aborted) return;
    control->fix(now, rover(), rtk_lost ? FixClass::single : FixClass::rtk_fixed);
    if (!silent_anchors && n % 4 == 0) {
      for (const std::uint32_t id : {0x6a21U, 0x6a22U})
        control->engine().range(now, NetworkId{id}, true, -80.0, 20.0);
    }
    control->round(now, {});
    (void)control->take_dispatched();
    for (auto& h : control->engine().take_events()) events.push_back(std::move(h));
    const auto s = step_now();
    using procedure::Step;
    if (autopilot.vehicle().in_air() && s != Step::take_off && s != Step::landing && s != Step::done)
      lowest_m = std::min(lowest_m, rover().z());
  }
  void receive(const std::vector<std::uint8_t>& bytes) {
    std::vector<mavlink::Received> in;
    down_.feed(bytes, in);
    for (const auto& one : in) {
      if (!one.message.is("HEARTBEAT")) continue;
      shown_mode = static_cast<std::uint32_t>(one.message.integer("custom_mode"));
      shown_s = now;
    }
  }
  void collect() {
    const auto out = session->take_bytes();
    if (out.empty()) return;
    std::vector<mavlink::Received> seen;
    up_.feed(out, seen);
    for (const auto& one : seen) note(one.message);
    if (!link_down) autopilot.feed(out);
  }
  void note(const mavlink::Message& m) {
    Wire w;
    w.at_s = now;
    if (m.is("SET_POSITION_TARGET_GLOBAL_INT")) {
      w.command = 86;
      w.target_m = autopilot.asked_m(m);
    } else if (m.is("COMMAND_LONG") || m.is("COMMAND_INT")) {
      w.command = static_cast<int>(m.integer("command"));
      w.p1 = m.real("param1");
      if (w.command == 511) return;
      if (w.command == 176)
        w.mode = autopilot.options().dialect == drone::Autopilot::px4
                     ? static_cast<std::uint32_t>(m.integer("param2")) << 16U |
                           static_cast<std::uint32_t>(m.integer("param3")) << 24U
                     : static_cast<std::uint32_t>(m.integer("param2"));
      if (w.command == 192) w.target_m = autopilot.asked_m(m);
      if (m.is("COMMAND_LONG")) w.again = m.integer("confirmation");
    } else {
      return;
    }
    wire.push_back(w);
  }

  mavlink::Framer up_, down_;
};

}  // namespace anchord::test
