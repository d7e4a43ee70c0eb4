#include "server/flight/piloted_loop.hpp"

#include <algorithm>
#include <chrono>

#include "core/geo/enu.hpp"
#include "core/localize/live_flight.hpp"
#include "core/planning/bounds.hpp"
#include "core/procedure/flight_control.hpp"
#include "drivers/drone/session.hpp"
#include "server/flight/sim_kit.hpp"

namespace anchord::flight {
namespace {

using procedure::Step;

constexpr double k_tick_s = 0.05;
constexpr int k_presses = 5;
const Eigen::Vector3d k_home_m{-9, -9, 0};

sim::AutopilotOptions autopilot_of(const sim::World& world, const PilotedLoopOptions& options) {
  auto out = options.autopilot;
  out.origin = world.origin;
  out.home_m = k_home_m;
  out.vehicle = options.loop.vehicle;
  out.ready_s = 1;
  return out;
}

/// Session and autopilot with the air between them.
class Air {
 public:
  explicit Air(sim::AutopilotOptions options) : autopilot(std::move(options)) {}
  void fly_until(double now_s) {
    while (now_s_ + k_tick_s <= now_s + 1e-9) {
      now_s_ += k_tick_s;
      const auto unix_us = autopilot.options().start_unix_us + static_cast<std::int64_t>(now_s_ * 1e6);
      autopilot.advance(now_s_);
      session.feed(now_s_, unix_us, autopilot.take_bytes());
      session.tick(now_s_, unix_us);
      autopilot.feed(session.take_bytes());
    }
  }
  sim::AutopilotSim autopilot;
  drone::Session session;

 private:
  double now_s_{0};
};

}  // namespace

Result<PilotedLoopResult> fly_piloted_loop(const sim::World& world, const Plan& plan,
                                           const PilotedLoopOptions& options) {
  BOOST_OUTCOME_TRY(auto setup, procedure::flight_setup(plan, k_home_m));
  setup.limits.battery_per_s = 1 / options.loop.vehicle.battery_s;
  const auto begun = std::chrono::steady_clock::now();
  const EnuFrame frame(setup.origin);
  Air air(autopilot_of(world, options));
  SimKit kit(world, options.loop.radio, options.loop.seed);
  std::optional<procedure::FlightControl> flight;
  LiveOptions live_options;
  live_options.origin = frame.origin();
  live_options.update_interval_s = options.loop.live_update_s;
  LiveFlight live(kit.mission(), live_options);
  const planning::Polygon outline{
      {0, 0}, {world.length_m, 0}, {world.length_m, world.width_m}, {0, world.width_m}};
  PilotedLoopResult out;
  auto& flown = out.flown;
  flown.data.mission = kit.mission();
  bool started = false, flew = false;
  std::uint64_t n_clues = 0;
  int presses = 0;
  flight.emplace(setup, frame, &air.session);
  while (kit.now_s() < options.loop.max_s) {
    auto& control = *flight;
    auto& engine = control.engine();
    const auto& vehicle = air.autopilot.vehicle();
    const Eigen::Vector3d before = vehicle.position_m();
    air.fly_until(kit.now_s() + SimKit::k_step_s);
    auto measured = kit.observe(before, vehicle);
    const double now = kit.now_s();
    for (auto& fix : measured.fixes) {
      control.fix(now, frame.enu_from_wgs84(fix.position).m, fix.fix);
      live.add(fix);
      flown.data.fixes.push_back(std::move(fix));
    }
    for (auto& range : measured.ranges) {
      live.add(range);
      flown.data.ranges.push_back(std::move(range));
    }
    for (const auto& r : live.take_ranges())
      engine.range(now, r.range.anchor, r.used(), r.range.rss_dbm, r.range.distance_m);
    if (options.loop.use_clues && n_clues != engine.clues_version()) {
      n_clues = engine.clues_version();
      flown.clues = procedure::clues_in(procedure::flight_clues(engine.clues(), frame), frame);
      live.tell(flown.clues);
    }
    if (!started && now > 12) started = control.start(now, "the simulation");
    for (const auto& report : air.session.take_reports()) control.report(now, report);
    const bool deciding = engine.state().step == Step::find_next_point;
    if (started) control.round(now, deciding ? live.estimates() : std::vector<Estimate>{});
    if (deciding) ++flown.n_decisions;
    flown.n_orders += control.take_dispatched().size();
    for (auto& h : engine.take_happenings()) flown.happenings.push_back(std::move(h));
    const auto step = engine.state().step;
    const Eigen::Vector3d at = vehicle.position_m();
    if (vehicle.in_air()) {
      const double edge_m = planning::distance_to_edge_m(outline, at.head<2>());
      out.clearance_m = std::min(out.clearance_m, planning::contains(outline, at.head<2>()) ? 0 : edge_m);
      if (step != Step::take_off && step != Step::landing && step != Step::done)
        out.lowest_m = std::min(out.lowest_m, at.z());
    }
    flew = flew || vehicle.in_air();
    if (step != Step::done) continue;
    // On a poor link a start may not be confirmed; the operator presses again.
    if (flew || ++presses == k_presses) break;
    flight.emplace(setup, frame, &air.session);
    started = false;
  }
  const auto& engine = flight->engine();
  out.landed = !air.autopilot.vehicle().in_air() && engine.state().step == Step::done;
  out.home_m = (air.autopilot.vehicle().position_m() - k_home_m).head<2>().norm();
  for (const auto& anchor : world.anchors) flown.data.anchor_names[anchor.id] = to_string(anchor.id);
  live.finish();
  flown.live = live.estimates();
  flown.state = engine.state();
  flown.flight_s = kit.now_s();
  flown.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return out;
}

}  // namespace anchord::flight
