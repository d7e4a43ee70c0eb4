#include <poll.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>
#include <thread>

#include "api/measurements/flight_requests.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "drivers/link/byte_link.hpp"
#include "drivers/sim/autopilot_script.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_client.hpp"
#include "server/cli/simulate_drone.hpp"
#include "server/cli/site_source.hpp"
#include "server/flight/closed_loop.hpp"
#include "server/flight/sim_kit.hpp"
#include "server/flight/site_world.hpp"

namespace anchord::cli {
namespace {

using SteadyClock = std::chrono::steady_clock;

struct SimulatedDroneOptions {
  std::string mavlink{"udp://127.0.0.1:14550"}, url{"http://127.0.0.1:8420"}, token_file, mission, scenario,
      site;
  std::uint64_t seed{1};
  double ready_s{5}, wind_mps{0}, battery_s{1200};
  bool px4{false}, walls{false};
};

/// Anything that goes wrong with one delivery is told and the flight goes on: a tag does not stop either.
template <class T>
bool told(const Result<T>& result) {
  if (!result)
    std::fprintf(stderr, "anchord simulate drone: %s\n", printable(result.error().message).c_str());
  return result.has_value();
}

class World {
 public:
  World(const SimulatedDroneOptions& options, RestClient& client, flight::Scene scene)
      : options_(options),
        client_(client),
        world_(std::move(scene.world)),
        autopilot_(autopilot_options(options, world_, scene.home_m)),
        kit_(world_, radio(), options.seed, SystemClock().now()),
        start_(SteadyClock::now()) {}

  Result<void> find_mission() {
    if (!options_.mission.empty()) {
      mission_ = options_.mission;
      BOOST_OUTCOME_TRY(mission_id_.uuid, parse_uuid(mission_));
      return boost::outcome_v2::success();
    }
    auto mission = kit_.mission();
    mission.name = "Simulated drone";
    if (!options_.site.empty()) {
      BOOST_OUTCOME_TRY(const auto site, parse_uuid(options_.site));
      mission.site = SiteId{site};
    }
    BOOST_OUTCOME_TRY(const auto made, client_.post("/api/v1/missions", "application/json",
                                                    api::mission_request_json(mission)));
    BOOST_OUTCOME_TRY(mission_, api::parse_created_id(made));
    BOOST_OUTCOME_TRY(mission_id_.uuid, parse_uuid(mission_));
    std::fprintf(stderr, "anchord simulate drone: mission %s\n", mission_.c_str());
    return boost::outcome_v2::success();
  }

  /// Flies on to the present; what was measured meanwhile goes to the server.
  void round(link::ByteLink& bytes) {
    happen();
    const double now_s = std::chrono::duration<double>(SteadyClock::now() - start_).count();
    while (kit_.now_s() + flight::SimKit::k_step_s <= now_s) {
      const Eigen::Vector3d before = autopilot_.vehicle().position_m();
      autopilot_.advance(kit_.now_s() + flight::SimKit::k_step_s);
      auto measured = kit_.observe(before, autopilot_.vehicle());
      auto rows = rows_.lock();
      for (auto& fix : measured.fixes) {
        fix.mission = mission_id_;
        api::append_ndjson(rows->fixes, fix);
      }
      for (auto& range : measured.ranges) {
        range.mission = mission_id_;
        api::append_ndjson(rows->ranges, range);
      }
    }
    const auto out = autopilot_.take_bytes();
    if (!out.empty()) (void)bytes.write({reinterpret_cast<const char*>(out.data()), out.size()}).has_value();
  }
  Result<void> read_scenario() {
    if (options_.scenario.empty()) return boost::outcome_v2::success();
    std::ifstream in(options_.scenario);
    if (!in) return make_error(Errc::not_found, options_.scenario + ": cannot be read");
    BOOST_OUTCOME_TRY(script_, sim::AutopilotScript::read(in));
    return boost::outcome_v2::success();
  }
  /// What the scenario and whoever sits before it let happen.
  void happen() {
    for (const auto& words : script_.due(autopilot_))
      std::fprintf(stderr, "anchord simulate drone: %s\n", words.c_str());
    pollfd typed{STDIN_FILENO, POLLIN, 0};
    // In the background a terminal is somebody else's: reading it would stop us.
    const bool ours = ::isatty(STDIN_FILENO) == 0 || ::tcgetpgrp(STDIN_FILENO) == ::getpgrp();
    while (reads_ && ours && ::poll(&typed, 1, 0) > 0) {
      std::array<char, 200> bytes{};
      const auto n = ::read(STDIN_FILENO, bytes.data(), bytes.size());
      reads_ = n > 0;
      if (n > 0) typed_.append(bytes.data(), static_cast<std::size_t>(n));
    }
    for (std::size_t end = 0; (end = typed_.find('\n')) != std::string::npos; typed_.erase(0, end + 1)) {
      if (end > 0) (void)told(sim::happen(autopilot_, std::string_view(typed_).substr(0, end)));
    }
  }
  void receive(std::string_view in) {
    autopilot_.feed({reinterpret_cast<const std::uint8_t*>(in.data()), in.size()});
  }
  /// On a thread of its own: a server that is away must not stop the aircraft.
  void deliver() {
    const std::string where = "?mission=" + mission_;
    const auto [fixes, ranges] = rows_.exchange({});
    if (!ranges.empty()) (void)told(client_.post("/api/v1/ranges" + where, "application/x-ndjson", ranges));
    if (!fixes.empty()) (void)told(client_.post("/api/v1/fixes" + where, "application/x-ndjson", fixes));
  }

 private:
  static sim::AutopilotOptions autopilot_options(const SimulatedDroneOptions& options,
                                                 const sim::World& world, const Eigen::Vector3d& home_m) {
    sim::AutopilotOptions out;
    out.dialect = options.px4 ? drone::Autopilot::px4 : drone::Autopilot::ardupilot;
    out.origin = world.origin;
    out.home_m = home_m;
    out.ready_s = options.ready_s;
    out.seed = options.seed;
    out.vehicle.wind_mps = {options.wind_mps, 0, 0};
    out.vehicle.battery_s = options.battery_s;
    out.start_unix_us = SystemClock().now().us();
    return out;
  }
  static sim::RadioOptions radio() {
    sim::RadioOptions out;
    out.turn_lobe_db = 6;
    out.height_lobe = true;
    return out;
  }

  const SimulatedDroneOptions& options_;
  RestClient& client_;
  sim::World world_;
  sim::AutopilotSim autopilot_;
  flight::SimKit kit_;
  SteadyClock::time_point start_;
  sim::AutopilotScript script_;
  std::string typed_;
  bool reads_{true};
  MissionId mission_id_{};
  std::string mission_;
  struct Rows {
    std::string fixes, ranges;
  };
  Locked<Rows> rows_;
};

/// The site's own, or the demonstration building.
Result<flight::Scene> scene_of(const SimulatedDroneOptions& options, RestClient& client) {
  if (options.site.empty())
    return flight::Scene{options.walls ? flight::walled_world() : sim::demonstration_world()};
  BOOST_OUTCOME_TRY(auto scene, fetch_site_scene(client, options.site));
  std::fprintf(stderr,
               "anchord simulate drone: %zu walls, %zu roofs, %zu anchors; the aircraft is %.0f m east, %.0f "
               "m north of the origin\n",
               scene.world.panels.size(), scene.world.slabs.size(), scene.world.anchors.size(),
               scene.home_m.x(), scene.home_m.y());
  if (scene.world.anchors.empty())
    return make_error(Errc::invalid_argument,
                      "site " + options.site +
                          " has neither a published anchor nor an accepted outline to place anchors in: "
                          "publish an anchor, or accept an outline");
  return scene;
}

int simulate_drone(const SimulatedDroneOptions& options) {
  const auto address = link::parse_address(options.mavlink);
  if (!told(address)) return 2;
  const auto token = read_token_file(options.token_file);
  if (!told(token)) return 2;
  auto client = RestClient::make(options.url, token.value(), interrupted);
  if (!told(client)) return 2;
  auto scene = scene_of(options, *client.value());
  if (!told(scene)) return 2;
  World world(options, *client.value(), std::move(scene).value());
  if (!told(world.read_scenario())) return 2;
  if (!told(world.find_mission())) return 1;
  boost::asio::io_context io;
  const auto bytes = link::make_link(io, address.value());
  bool lost = false;
  link::LinkHandlers handlers;
  handlers.on_bytes = [&](std::string_view in, const link::Arrival&) { world.receive(in); };
  handlers.on_closed = [&](const Error& why) {
    std::fprintf(stderr, "anchord simulate drone: %s\n", printable(why.message).c_str());
    lost = true;
  };
  bytes->open(std::move(handlers));
  std::atomic<bool> over{false};
  Thread deliverer("deliverer", [&] {
    while (!over && !interrupted()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
      world.deliver();
    }
  });
  auto next = SteadyClock::now();
  while (!interrupted() && !lost) {
    io.restart();
    next += std::chrono::milliseconds(50);
    io.run_until(next);
    std::this_thread::sleep_until(next);
    world.round(*bytes);
  }
  over = true;
  deliverer.join();
  return lost ? 1 : 0;
}

}  // namespace

void add_simulate_drone(CLI::App& simulate, int& exit_code) {
  auto o = std::make_shared<SimulatedDroneOptions>();
  auto* command = simulate.add_subcommand(
      "drone", "Simulate an aircraft: MAVLink on a socket, its tag and rover as measurements of a mission");
  command
      ->add_option(
          "--mavlink", o->mavlink,
          "where MAVLink is sent: udp://127.0.0.1:PORT for a server with --drone-address udp://:PORT")
      ->capture_default_str();
  command->add_option("--url", o->url, "of the server")->capture_default_str();
  command->add_option("--token-file", o->token_file, "file with an access token (gateway and operator)");
  command->add_option("--mission", o->mission, "mission that gets the measurements [a new one]");
  command->add_option("--seed", o->seed, "Seed; the same seed gives the same noise")->capture_default_str();
  command->add_option("--ready", o->ready_s, "seconds until the pre-arm checks pass")->capture_default_str();
  command->add_option("--wind", o->wind_mps, "wind from the west in m/s")->capture_default_str();
  command->add_option("--battery", o->battery_s, "seconds of flight on a full battery")
      ->capture_default_str();
  command->add_option("--scenario", o->scenario,
                      "file with lines of \"seconds event\", like \"30 pilot LOITER\"; on standard input the "
                      "same without the seconds (drivers/sim/autopilot.md)");
  command->add_flag("--px4", o->px4, "behave as PX4 [ArduPilot]");
  auto* walls = command->add_flag("--walls", o->walls, "building with brick fronts instead of glass");
  command
      ->add_option("--site", o->site,
                   "id of a site: its accepted walls delay ranges, its published anchors answer [the "
                   "demonstration building]")
      ->excludes(walls);
  command->callback([o, &exit_code] { exit_code = simulate_drone(*o); });
}

}  // namespace anchord::cli
