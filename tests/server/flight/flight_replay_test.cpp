// A recorded flight replayed: the same measurements, telemetry and orders give the same events and the same
// commands, byte for byte. Everything runs inline, without a thread.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <set>
#include <stdexcept>

#include "drivers/drone/session.hpp"
#include "drivers/sim/autopilot.hpp"
#include "server/flight/closed_loop.hpp"
#include "server/flight/inline_flight.hpp"
#include "server/flight/sim_kit.hpp"

namespace anchord::flight_replay_test {
namespace {

constexpr std::int64_t k_unix_us = 1'777'888'800'000'000;
constexpr double k_flight_s = 300;

std::string exact(double value) {
  char text[40];
  std::snprintf(text, sizeof text, " %a", value);
  return text;
}

/// What the aircraft answered, in the order it was asked.
struct Answers {
  std::deque<DroneStatus> status;
  std::deque<std::vector<CommandReport>> reports;
  std::deque<std::uint64_t> numbers;
};

/// A drone whose commands are written down; how it answers is its maker's.
class WrittenDrone : public Drone {
 public:
  std::string commands;

  void new_flight(double speed_mps) override { write("new_flight" + exact(speed_mps)); }
  void end_flight() override { write("end_flight"); }
  std::uint64_t take_off(double m) override { return number("take_off" + exact(m), &Drone::take_off, m); }
  std::uint64_t go_to(double lat, double lon, double m, std::optional<double> heading) override {
    return number("go_to" + exact(lat) + exact(lon) + exact(m) + exact(heading.value_or(-1)), &Drone::go_to,
                  lat, lon, m, heading);
  }
  void steer(double lat, double lon, double m) override {
    write("steer" + exact(lat) + exact(lon) + exact(m));
    if (real() != nullptr) real()->steer(lat, lon, m);
  }
  std::uint64_t hold() override { return number("hold", &Drone::hold); }
  std::uint64_t return_home() override { return number("return_home", &Drone::return_home); }
  std::uint64_t land() override { return number("land", &Drone::land); }
  std::uint64_t disarm() override { return number("disarm", &Drone::disarm); }
  std::uint64_t upload_route(const std::vector<RoutePoint>& r) override {
    return number("upload_route", &Drone::upload_route, r);
  }
  std::uint64_t upload_fence(const DroneFence& f) override {
    return number("upload_fence", &Drone::upload_fence, f);
  }
  void ask_parameters(const std::vector<std::string>& names) override {
    if (real() != nullptr) real()->ask_parameters(names);
  }
  void take_back() override {
    write("take_back");
    if (real() != nullptr) real()->take_back();
  }

 protected:
  virtual Drone* real() { return nullptr; }
  virtual std::uint64_t answered(std::uint64_t of_the_real) = 0;
  void write(const std::string& what) { commands += what + '\n'; }

 private:
  template <class Call, class... Args>
  std::uint64_t number(const std::string& what, Call call, const Args&... args) {
    write(what);
    return answered(real() != nullptr ? (real()->*call)(args...) : 0);
  }
};

/// The simulated aircraft, and what it answered.
class RecordedDrone final : public WrittenDrone {
 public:
  explicit RecordedDrone(drone::Session& session) : session_(session) {}
  void new_flight(double speed_mps) override {
    WrittenDrone::new_flight(speed_mps);
    session_.new_flight(speed_mps);
  }
  void end_flight() override {
    WrittenDrone::end_flight();
    session_.end_flight();
  }
  DroneStatus status() const override {
    answers.status.push_back(session_.status());
    return answers.status.back();
  }
  std::vector<CommandReport> take_reports() override {
    answers.reports.push_back(session_.take_reports());
    return answers.reports.back();
  }
  mutable Answers answers;

 private:
  Drone* real() override { return &session_; }
  std::uint64_t answered(std::uint64_t number) override {
    answers.numbers.push_back(number);
    return number;
  }
  drone::Session& session_;
};

/// Answers as was recorded.
class ReplayedDrone final : public WrittenDrone {
 public:
  explicit ReplayedDrone(Answers answers) : answers_(std::move(answers)) {}
  DroneStatus status() const override { return next(answers_.status); }
  std::vector<CommandReport> take_reports() override { return next(answers_.reports); }

 private:
  template <class Queue>
  static typename Queue::value_type next(Queue& queue) {
    if (queue.empty()) throw std::runtime_error("the aircraft is asked more often than in the recording");
    auto out = std::move(queue.front());
    queue.pop_front();
    return out;
  }
  std::uint64_t answered(std::uint64_t) override { return next(answers_.numbers); }
  mutable Answers answers_;
};

/// What came in one tenth of a second.
struct Tick {
  flight::Now now;
  std::vector<Fix> fixes;
  std::vector<Range> ranges;
};

/// A flight whose every event is written down.
class Home {
 public:
  Home(const Mission& mission, const Plan& plan, Drone& drone) : flight_({mission, plan}, drone) {
    flight_.on_event = [this](const flight::Event& event) {
      std::visit([this](const auto& e) { take(e); }, event);
    };
    flight_.on_position = [this](const flight::PositionEvent& event) {
      std::visit([this](const auto& e) { take(e); }, event);
    };
  }

  void run(const Tick& tick) {
    flight_.step(tick.now, tick.fixes, tick.ranges);
    if (!begun_ && tick.now.s > 12) {
      const auto begun = flight_.start(tick.now);
      written += begun ? "begun\n" : begun.error().message + '\n';
      begun_ = begun.has_value();
    }
    for (const auto& line : flight_.take_log()) written += line.code + ' ' + line.text + '\n';
    const auto& f = flight_.flight();
    if (f)
      written += std::string(flight::k_flight_status_words.word(f->status())) + ' ' +
                 f->control.engine().state().reason + '\n';
    steps.insert(f ? std::string(procedure::to_string(f->control.engine().state().step)) : "none");
  }
  std::string written;
  std::set<std::string> steps;
  std::vector<Estimate> estimates() { return flight_.live().estimates(); }

 private:
  void take(const flight::RangeDecided& e) {
    written += "range " + std::to_string(e.result.range.time.ns) + ' ' + e.result.refused +
               exact(e.result.residual_m.value_or(-1)) + '\n';
  }
  void take(const flight::AnchorEstimated& e) {
    written += "estimate " + to_string(e.estimate.anchor) + exact(e.estimate.h95_m);
    if (e.estimate.best)
      for (int i = 0; i < 3; ++i) written += exact(e.estimate.best->position.m[i]);
    written += '\n';
  }
  void take(const flight::PoseMoved& e) {
    written += "pose " + std::to_string(e.time.ns);
    for (int i = 0; i < 3; ++i) written += exact(e.enu_m[i]);
    written += exact(e.speed_mps.value_or(-1)) + '\n';
  }
  void take(const flight::FixBelieved& e) { written += "believed " + std::to_string(e.fix.time.ns) + '\n'; }
  void take(const flight::FixShown& e) { written += "shown " + std::to_string(e.fix.time.ns) + '\n'; }
  template <class Event>
  void take(const Event&) {
    written += "event " + std::to_string(flight::Event(Event{}).index()) + '\n';
  }

  flight::InlineFlight flight_;
  bool begun_{false};
};

TEST(FlightReplay, ARecordedFlightGivesTheSameEventsAndCommandsByteForByte) {
  const auto world = sim::demonstration_world();
  auto plan = flight::plan_from_outline(world).value();
  for (auto& waypoint : plan.waypoints) waypoint.turn = true;
  sim::AutopilotOptions options;
  options.origin = world.origin;
  options.home_m = {-9, -9, 0};
  options.ready_s = 0;
  sim::AutopilotSim autopilot(options);
  drone::Session session;
  RecordedDrone aircraft(session);
  flight::SimKit kit(world, {}, 1);
  Mission mission = kit.mission();
  mission.id = MissionId{make_uuid_v7(UtcTime::from_us(k_unix_us))};
  Home flown(mission, plan, aircraft);
  std::vector<Tick> recording;
  double air_s = 0;
  while (kit.now_s() < k_flight_s) {
    const Eigen::Vector3d before = autopilot.vehicle().position_m();
    for (int half = 0; half < 2; ++half) {
      air_s += flight::SimKit::k_step_s / 2;
      const auto unix_us = k_unix_us + static_cast<std::int64_t>(air_s * 1e6);
      autopilot.advance(air_s);
      session.feed(air_s, unix_us, autopilot.take_bytes());
      session.tick(air_s, unix_us);
      autopilot.feed(session.take_bytes());
    }
    auto measured = kit.observe(before, autopilot.vehicle());
    Tick tick;
    tick.now.s = air_s;
    tick.now.utc = UtcTime::from_us(k_unix_us + static_cast<std::int64_t>(air_s * 1e6));
    tick.now.steady = {static_cast<std::int64_t>(air_s * 1e9)};
    for (auto& fix : measured.fixes) fix.mission = mission.id;
    for (auto& range : measured.ranges) range.mission = mission.id;
    tick.fixes = std::move(measured.fixes);
    tick.ranges = std::move(measured.ranges);
    flown.run(tick);
    recording.push_back(std::move(tick));
  }
  EXPECT_TRUE(flown.steps.contains("ranging")) << flown.written.substr(0, 3000);
  EXPECT_GT(std::ranges::count(aircraft.commands, '\n'), 20);
  EXPECT_FALSE(flown.estimates().empty());
  for (const auto& estimate : flown.estimates()) {
    const auto target = std::ranges::find(estimate.gates, k_goal_sigma, &Gate::name);
    ASSERT_NE(target, estimate.gates.end()) << to_string(estimate.anchor) << ": the flown plan has a target";
    EXPECT_EQ(target->limit, plan.settings.target_sigma_m);
  }
  for (int time = 0; time < 2; ++time) {
    ReplayedDrone replayed(aircraft.answers);
    Home home(mission, plan, replayed);
    for (const auto& tick : recording) home.run(tick);
    EXPECT_EQ(home.written, flown.written);
    EXPECT_EQ(replayed.commands, aircraft.commands);
  }
}

}  // namespace
}  // namespace anchord::flight_replay_test
