#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>
#include <type_traits>
#include <vector>

#include "app_fixture.hpp"
#include "core/ports/drone.hpp"
#include "drivers/drone/session.hpp"
#include "drivers/sim/autopilot.hpp"
#include "drivers/sim/wgs84.hpp"

namespace anchord::test {

inline constexpr std::int64_t k_unix_us = 1'777'888'800'000'000;
inline const Eigen::Vector3d k_home_m{-9, -9, 0};

/// Session and autopilot, joined without a wire.
class LoopDrone final : public Drone {
 public:
  explicit LoopDrone(bool keeps_fences = true)
      : autopilot([&] {
          sim::AutopilotOptions o;
          o.ready_s = 0;
          o.keeps_fences = keeps_fences;
          o.home_m = k_home_m;
          return o;
        }()) {}

  void run_until(double seconds) {
    const std::lock_guard turn(in_use);
    while (now < seconds - 1e-9) {
      now += 0.05;
      const auto unix_us = k_unix_us + static_cast<std::int64_t>(now * 1e6);
      autopilot.advance(now);
      session.feed(now, unix_us, autopilot.take_bytes());
      session.tick(now, unix_us);
      const auto out = session.take_bytes();
      if (!link_down) autopilot.feed(out);
    }
  }
  void new_flight(double speed_mps) override {
    alone([&] { session.new_flight(speed_mps); });
  }
  void end_flight() override {
    alone([&] { session.end_flight(); });
  }
  std::uint64_t take_off(double m) override {
    return alone([&] { return session.take_off(m); });
  }
  void steer(double lat, double lon, double m) override {
    alone([&] { session.steer(lat, lon, m); });
  }
  std::uint64_t disarm() override {
    return alone([&] { return session.disarm(); });
  }
  void ask_parameters(const std::vector<std::string>& names) override {
    alone([&] { session.ask_parameters(names); });
  }
  std::uint64_t go_to(double lat, double lon, double m, std::optional<double> heading) override {
    return alone([&] {
      targets.push_back({lat, lon, m});
      return session.go_to(lat, lon, m, heading);
    });
  }
  std::uint64_t hold() override {
    return alone([&] {
      ++holds;
      return session.hold();
    });
  }
  std::uint64_t return_home() override {
    return alone([&] { return session.return_home(); });
  }
  std::uint64_t land() override {
    return alone([&] { return session.land(); });
  }
  std::uint64_t upload_route(const std::vector<RoutePoint>& route) override {
    return alone([&] { return session.upload_route(route); });
  }
  std::uint64_t upload_fence(const DroneFence& fence) override {
    return alone([&] { return session.upload_fence(fence); });
  }
  void take_back() override {
    alone([&] { session.take_back(); });
  }
  void expect(const DroneIdentity& aircraft) override {
    alone([&] {
      expected = aircraft;
      session.expect_vehicle(
          {static_cast<std::uint8_t>(aircraft.system), static_cast<std::uint8_t>(aircraft.component)});
    });
  }
  DroneStatus status() const override {
    return alone([&] { return session.status(); });
  }
  std::vector<CommandReport> take_reports() override {
    return alone([&] { return session.take_reports(); });
  }

  sim::AutopilotSim autopilot;
  drone::Session session;
  std::vector<Wgs84> targets;
  std::optional<DroneIdentity> expected;
  double now{0};
  std::atomic<int> holds{0};
  std::atomic<bool> link_down{false};

 private:
  /// The application's threads ask while a test flies on, as they do of a real link.
  template <class Act>
  std::invoke_result_t<Act> alone(Act act) const {
    const std::lock_guard turn(in_use);
    return act();
  }
  mutable std::mutex in_use;
};

class Flights : public AppFixture {
 protected:
  void SetUp() override {
    drone_ = std::make_unique<LoopDrone>();
    AppFixture::SetUp();
  }
  void TearDown() override {
    AppFixture::TearDown();
    drone_.reset();
  }
  void configure(api::Application::Deps& deps) override {
    deps.drone = with_drone_ ? drone_.get() : nullptr;
    deps.flight_clock = [this] { return drone_->now; };
    deps.calibrate_landed = calibrates_;
  }
  std::string origin_text() const { return R"({"lon":3.7131,"lat":51.0231,"h_m":55.5})"; }
  std::string make_plan(const std::string& more = "") {
    const auto made = post("/api/v1/plans", R"({"name":"Hall",)" + more +
                                                R"("building_height_m":8,"origin":)" + origin_text() + R"(,
      "outline":{"type":"Polygon","coordinates":[[[3.7131,51.0231],[3.7135275,51.0231],[3.7135275,51.0232799],[3.7131,51.0232799]]]},
      "settings":{"keep_out_m":4,"max_height_m":20},
      "waypoints":[{"lon":3.7130,"lat":51.02305,"height_above_ground_m":4},
                   {"lon":3.71362,"lat":51.02305,"height_above_ground_m":9}]})");
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made)["id"];
  }
  /// Flies on; ten fixes a second come in as from a rover on the aircraft.
  void fly(double seconds) {
    for (const double end = drone_->now + seconds; drone_->now < end - 1e-9;) {
      drone_->run_until(drone_->now + 0.1);
      const auto at = sim::wgs84_from_enu({51.0231, 3.7131, 55.5}, drone_->autopilot.vehicle().position_m());
      char row[300];
      std::snprintf(
          row, sizeof row,
          R"({"t_us":%lld,"lon":%.10f,"lat":%.10f,"h_m":%.4f,"fix":"fixed","sigma_m":[0.01,0.01,0.02],)"
          R"("correction_age_s":0.8%s})"
          "\n",
          static_cast<long long>(k_unix_us + std::llround(drone_->now * 1e6)), at.lon_deg, at.lat_deg,
          at.height_m, faces_east_ ? R"(,"heading_deg":90)" : "");
      const auto taken = post("/api/v1/fixes", row, "application/x-ndjson", {{"mission", mission_}});
      ASSERT_EQ(taken.status, 200) << taken.body;
      app_->fly();
    }
  }
  /// Flies on with five ranges a second of one anchor at (10, 5, 2) m.
  void measure(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 5); ++i) {
      fly(0.2);
      const Eigen::Vector3d at = drone_->autopilot.vehicle().position_m();
      const auto t_us = k_unix_us + std::llround(drone_->now * 1e6);
      const Json row{{"t_us", t_us},
                     {"tag", "0x6e01"},
                     {"anchor", "0x6a21"},
                     {"distance_m", (at - Eigen::Vector3d(10, 5, 2)).norm()}};
      ASSERT_EQ(
          post("/api/v1/ranges", row.dump() + "\n", "application/x-ndjson", {{"mission", mission_}}).status,
          200);
    }
  }
  template <class Done>
  bool fly_until(Done done, double seconds) {
    for (const double end = drone_->now + seconds; drone_->now < end;) {
      fly(0.5);
      if (done()) return true;
    }
    return false;
  }
  Json procedure() { return json(get(base() + "/procedure")); }
  std::string base() const { return "/api/v1/missions/" + mission_; }
  Json control(const std::string& body = R"({"action":"take"})") {
    const auto answer = post(base() + "/control", body);
    EXPECT_EQ(answer.status, 200) << answer.body;
    return json(answer);
  }
  api::Response act(const std::string& action, const std::string& lease, const std::string& more = "") {
    return post(base() + "/actions", R"({"action":")" + action + R"(","lease":")" + lease + '"' + more + '}');
  }
  void check_everything() {
    for (const char* item : {"props", "airspace", "people", "pilot", "tag", "disk", "battery"}) {
      const auto said = post(base() + "/checklist/" + item, R"({"reason":"looked at it"})");
      ASSERT_EQ(said.status, 200) << said.body;
    }
  }
  std::string command_state(std::uint64_t number) {
    std::string state;
    const Json now = procedure();
    for (const auto& c : now["commands"]) {
      if (c["number"] == number) state = c["state"];
    }
    return state;
  }
  /// In the air at the first waypoint's side; the lease.
  std::string take_off(const std::string& mission_id = "") {
    mission_ = mission_id.empty() ? mission() : mission_id;
    const auto plan = make_plan();
    fly(12);
    check_everything();
    const std::string lease = control()["lease"];
    const auto started = act("start", lease, R"(,"plan":")" + plan + '"');
    EXPECT_EQ(started.status, 202) << started.body;
    start_ = json(started)["number"];
    EXPECT_TRUE(fly_until([&] { return procedure()["step"] == "go_to_waypoint"; }, 60))
        << procedure().dump(1);
    return lease;
  }

  std::unique_ptr<LoopDrone> drone_;
  bool with_drone_{true};
  bool calibrates_{false};
  bool faces_east_{false};  ///< the fixes say so, whatever it flies; else they have no heading
  std::string mission_;
  std::uint64_t start_{};
};

}  // namespace anchord::test
