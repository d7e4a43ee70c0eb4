// Random histories: pilot, failsafes, link cuts, restarts of either side, refusals, late and lost answers,
// operators' commands in any order. What must hold in every one of them is checked at every step.
//   ANCHORD_HISTORIES=10000 for the long form; ANCHORD_HISTORY=N flies history N alone and says what happens.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "air_rig.hpp"
#include "core/planning/bounds.hpp"

namespace anchord::test::histories_test {
namespace {

using drone::Autopilot;
using procedure::Step;

constexpr double k_history_s = 120;
constexpr double k_oldest_s = 2.05;  ///< of a repeat; a tick is 0.05 s

class History {
 public:
  History(std::uint64_t seed, bool talk) : random_(seed), talk_(talk), rig_(options(seed)) {}

  void run() {
    const int n = 3 + static_cast<int>(random_.uniform() * 12);
    std::vector<double> at_s{7};
    for (int i = 0; i < n; ++i) at_s.push_back(8 + random_.uniform() * (k_history_s - 8));
    std::sort(at_s.begin(), at_s.end());
    advance(7);
    order("start");
    for (std::size_t i = 1; i < at_s.size() && broken_.empty(); ++i) {
      advance(at_s[i]);
      happen();
    }
    advance(k_history_s);
    end();
  }
  const std::string& broken() const { return broken_; }

 private:
  sim::AutopilotOptions options(std::uint64_t seed) {
    sim::AutopilotOptions o;
    o.seed = seed;
    o.dialect = random_.chance(0.5) ? Autopilot::px4 : Autopilot::ardupilot;
    o.loss = random_.chance(0.5) ? 0.3 * random_.uniform() : 0;
    o.loss_in = random_.chance(0.5) ? 0.3 * random_.uniform() : 0;
    o.duplicate = 0.1 * random_.uniform();
    o.latency_s = random_.chance(0.5) ? 0.4 * random_.uniform() : 0;
    o.ack_loss = random_.chance(0.3) ? 0.5 : 0;
    o.ack_delay_s = random_.chance(0.3) ? 3 * random_.uniform() : 0;
    o.mode_lag_s = random_.chance(0.3) ? 0.4 * random_.uniform() : 0;
    o.gnss_offset_m = {2 * random_.uniform() - 1, 2 * random_.uniform() - 1, 3 * random_.uniform() - 1.5};
    o.baro_drift_mps = 0.04 * (random_.uniform() - 0.5);
    return o;
  }
  const drone::Dialect& dialect() { return drone::dialect_of(rig_.autopilot.options().dialect); }
  bool px4() { return rig_.autopilot.options().dialect == Autopilot::px4; }
  void say(const std::string& words) {
    if (talk_)
      std::printf("%7.2f  %-12s %-16s %s\n", rig_.now, rig_.session->status().mode.c_str(),
                  std::string(procedure::to_string(rig_.step_now())).c_str(), words.c_str());
  }
  void fail(const std::string& why) {
    if (broken_.empty()) broken_ = std::to_string(rig_.now) + " s: " + why;
    say("BROKEN " + why);
  }

  void order(const std::string& action) {
    const bool lives = !rig_.link_down && rig_.session->status().connected;
    const auto before = rig_.wire.size();
    const bool had = rig_.flying() && rig_.control->taken_over();
    const auto why = rig_.act(action);
    say("operator: " + action + (why.empty() ? "" : " (" + why + ")"));
    if (why.empty()) ordered_s_ = rig_.now;
    // Taking back is an operator's word, and the pilot's from then on is another.
    if (why.empty() && had) pilot_s_.reset();
    if (action == "start" && why.empty()) pilot_s_.reset();
    if ((action == "hold" || action == "land") && lives) {
      if (!why.empty()) fail(action + " was refused: " + why);
      bool there = false;
      for (auto i = before; i < rig_.wire.size(); ++i)
        there = there || rig_.wire[i].mode == (action == "hold" ? dialect().hold : dialect().land) ||
                rig_.wire[i].command == 192;
      if (!there) fail(action + " did not reach the wire");
    }
    judge(before);
  }

  /// The sticks, or a failsafe: the mode is not ours any more.
  void pilot(std::uint32_t mode, const std::string& what) {
    say(what);
    pilot_mode_ = mode;
    pilot_s_ = rig_.now;
    known_s_.reset();
  }

  void happen() {
    const double dice = random_.uniform();
    auto& copter = rig_.autopilot;
    if (dice < 0.14) {
      static constexpr std::array<std::uint32_t, 4> k_sticks{0, 2, 5, 16};
      const auto mode = px4() ? (1U + static_cast<unsigned>(random_.uniform() * 3)) << 16U
                              : k_sticks[static_cast<std::size_t>(random_.uniform() * 4)];
      if (copter.custom_mode() == mode) return;
      copter.pilot_takes_over(mode);
      if (copter.vehicle().in_air()) pilot(mode, "pilot: mode " + std::to_string(mode));
    } else if (dice < 0.18) {
      if (!copter.vehicle().in_air()) return;
      copter.pilot_lands();
      pilot(copter.custom_mode(), "pilot lands");
    } else if (dice < 0.24) {
      if (!copter.vehicle().in_air() || copter.custom_mode() == dialect().return_home) return;
      copter.fail(random_.chance(0.5) ? sim::AutopilotSim::Failsafe::radio
                                      : sim::AutopilotSim::Failsafe::ekf);
      pilot(copter.custom_mode(), "failsafe");
    } else if (dice < 0.36) {
      rig_.link_down = true;
      link_s_ = rig_.now + 0.2 + 25 * random_.uniform() * random_.uniform();
      say("link cut until " + std::to_string(link_s_));
    } else if (dice < 0.40) {
      if (copter.restart()) say("autopilot restarted");
    } else if (dice < 0.46) {
      refuses_ = !refuses_;
      copter.refuse_arming(refuses_ ? "Throttle too high" : "");
      say(refuses_ ? "arming is refused" : "arming is allowed");
    } else if (dice < 0.50) {
      rig_.rtk_lost = !rig_.rtk_lost;
      lost_s_ = rig_.now;
      say(rig_.rtk_lost ? "RTK lost" : "RTK back");
    } else if (dice < 0.56) {
      say("server killed");
      rig_.restart_server(0.5 + 5 * random_.uniform());
      ordered_s_ = rig_.now;
      known_s_.reset();
      seen_wire_ = rig_.wire.size();
      say("server back");
    } else {
      static const std::array<const char*, 9> k_actions{"start", "hold", "resume", "skip",  "return",
                                                        "land",  "hold", "resume", "disarm"};
      auto action = std::string(k_actions[static_cast<std::size_t>(random_.uniform() * 9)]);
      if (random_.chance(0.04)) action = "abort";
      order(action);
    }
  }

  void judge(std::size_t from) {
    for (auto i = from; i < rig_.wire.size(); ++i) judge(rig_.wire[i]);
    seen_wire_ = rig_.wire.size();
  }

  void judge(const AirRig::Wire& w) {
    const auto words = "command " + std::to_string(w.command) + " mode " + std::to_string(w.mode);
    say("    sends " + words + (w.again ? " again" : ""));
    const double since_order_s = rig_.now - ordered_s_;
    const bool disarms = w.command == 400 && w.p1 < 0.5;
    if (!rig_.flying() && since_order_s > k_oldest_s && !disarms &&
        !(ended_s_ && rig_.now - *ended_s_ < k_oldest_s))
      fail(words + " although nothing flies");
    if (pilot_s_ && known_s_ && rig_.now - *known_s_ > 0.01 && ordered_s_ <= *pilot_s_ && !disarms)
      fail(words + " although the pilot has the aircraft");
    const auto key = std::tuple{w.command, w.mode, w.p1};
    if (w.again == 0)
      first_s_[key] = rig_.now;
    else if (first_s_.contains(key) && rig_.now - first_s_[key] > k_oldest_s)
      fail(words + " is " + std::to_string(rig_.now - first_s_[key]) + " s old");
    if ((w.command == 86 || w.command == 192) && rig_.control && !had_leg_ && !rig_.control->engine().leg())
      fail("a target although there is none");
    if (w.target_m && rover_known()) within(*w.target_m, "sends it");
  }

  void advance(double until_s) {
    while (rig_.now < until_s && broken_.empty()) {
      if (rig_.link_down && rig_.now >= link_s_) {
        rig_.link_down = false;
        say("link back");
      }
      const auto mode = rig_.autopilot.custom_mode();
      const bool flew = rig_.flying();
      had_leg_ = rig_.control && rig_.control->engine().leg();
      rig_.step();
      if (flew && !rig_.flying()) ended_s_ = rig_.now;
      // A failsafe of the autopilot's own, as that of the cut link.
      if (rig_.autopilot.failsafe() && rig_.autopilot.custom_mode() != mode &&
          (rig_.autopilot.custom_mode() == dialect().return_home ||
           rig_.autopilot.custom_mode() == dialect().land))
        pilot(rig_.autopilot.custom_mode(), "failsafe of its own");
      if (pilot_s_ && !known_s_ && rig_.shown_mode == pilot_mode_ && rig_.shown_s > *pilot_s_ && distinct())
        known_s_ = rig_.now;
      if (rig_.control && rig_.step_now() != last_step_) {
        last_step_ = rig_.step_now();
        step_s_ = rig_.now;
        say(rig_.reason());
      }
      judge(seen_wire_);
      inside();
    }
  }

  /// What the server commanded lately cannot be told from a pilot who chose the same; nor can the mode that
  /// the aircraft was in when an operator took it back, until the answer and a heartbeat have come.
  bool distinct() {
    const bool ours = pilot_mode_ == dialect().land || pilot_mode_ == dialect().return_home ||
                      pilot_mode_ == dialect().hold || pilot_mode_ == dialect().guided;
    bool commanded = false;
    for (auto it = rig_.wire.rbegin(); it != rig_.wire.rend() && !commanded; ++it)
      commanded = it->command == 176 && it->mode == pilot_mode_;
    return !(ours && commanded) && rig_.now - ordered_s_ > 5.5;
  }

  /// The aircraft's aim by the rover, while it flies targets.
  void inside() {
    const auto aim = rig_.autopilot.aim_m();
    const auto step = rig_.step_now();
    if (aim && (!aim_m_ || (*aim - *aim_m_).norm() > 0.5)) aim_m_ = aim, aim_s_ = rig_.now;
    // What it aims at by itself for a moment, when its mode changes, is nobody's target.
    if (rig_.now - aim_s_ < 2 || rig_.now - step_s_ < 2.5) return;
    if (!aim || !rig_.flying() || rig_.control->taken_over() || step == Step::take_off ||
        step == Step::hold || rig_.autopilot.custom_mode() != dialect().guided || pilot_s_ ||
        rig_.link_down || !rover_known() || !rig_.control->engine().leg())
      return;
    within(*aim, "aims");
  }

  /// Without RTK for longer than the procedure flies without it, nobody knows by the rover where it is.
  bool rover_known() const { return !rig_.rtk_lost || rig_.now - lost_s_ < 10; }

  /// A metre is the tolerance of a breach: GNSS is off by more than that, and corrected by the rover.
  void within(const Eigen::Vector3d& aim, const std::string& who) {
    auto bounds = AirRig::setup(rig_.home).limits.bounds;
    bounds.keep_out_m -= 1;
    *bounds.min_height_m -= 1;
    *bounds.max_height_m += 1;
    for (auto& corner : bounds.fence) corner += (corner - Eigen::Vector2d(15, 10)).normalized();
    if (const auto refusal = planning::refuse_point(bounds, aim))
      fail(who + " to " + std::to_string(aim.x()) + ' ' + std::to_string(aim.y()) + ' ' +
           std::to_string(aim.z()) + ": " + std::string(planning::to_string(*refusal)));
  }

  /// Somebody looks after it in the end: the history ends on the ground, or in the pilot's hands.
  void end() {
    rig_.rtk_lost = false;
    const auto over = [&] { return !rig_.autopilot.vehicle().in_air() && !rig_.flying(); };
    for (int i = 0; i < 6 && broken_.empty() && !over(); ++i) {
      rig_.link_down = false;
      advance(rig_.now + 8);
      if (rig_.flying() && rig_.control->taken_over()) {  // the pilot lands it
        if (rig_.autopilot.custom_mode() != dialect().land &&
            rig_.autopilot.custom_mode() != dialect().return_home)
          rig_.autopilot.pilot_lands();
      } else {
        order(rig_.flying() && i == 0 ? "return" : "land");
      }
      for (const double until_s = rig_.now + 120; rig_.now < until_s && broken_.empty() && !over();)
        advance(rig_.now + 1);
    }
    if (broken_.empty() && rig_.autopilot.vehicle().in_air()) fail("it is still in the air");
    advance(rig_.now + 14);
    if (broken_.empty() && rig_.autopilot.vehicle().armed()) fail("it is still armed");
    if (broken_.empty() && rig_.flying() && !rig_.control->taken_over() && rig_.step_now() != Step::take_off)
      fail("the flight has no end: " + rig_.reason());
  }

  sim::Random random_;
  bool talk_;
  AirRig rig_;
  std::string broken_;
  double link_s_{0}, ordered_s_{0};
  bool refuses_{false}, had_leg_{false};
  std::optional<double> pilot_s_, known_s_, ended_s_;
  std::optional<Eigen::Vector3d> aim_m_;
  double aim_s_{0}, step_s_{0}, lost_s_{0};
  std::uint32_t pilot_mode_{0};
  std::size_t seen_wire_{0};
  Step last_step_{};
  std::map<std::tuple<int, std::uint32_t, double>, double> first_s_;
};

TEST(FlightHistories, NoneBreaksWhatMustHold) {
  const char* one = std::getenv("ANCHORD_HISTORY");
  const char* many = std::getenv("ANCHORD_HISTORIES");
  const std::uint64_t first = one != nullptr ? std::strtoull(one, nullptr, 10) : 1;
  const std::uint64_t n = one != nullptr ? 1 : many != nullptr ? std::strtoull(many, nullptr, 10) : 500;
  int broken = 0;
  for (std::uint64_t seed = first; seed < first + n && broken < 20; ++seed) {
    History history(seed, one != nullptr);
    history.run();
    if (history.broken().empty()) continue;
    ++broken;
    ADD_FAILURE() << "history " << seed << ": " << history.broken();
  }
}

}  // namespace
}  // namespace anchord::test::histories_test
