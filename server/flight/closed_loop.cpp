#include "server/flight/closed_loop.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>

#include "core/geo/enu.hpp"
#include "core/planning/bounds.hpp"
#include "core/planning/flight_plan.hpp"
#include "core/planning/local_plan.hpp"
#include "drivers/drone/session.hpp"
#include "server/flight/inline_flight.hpp"
#include "server/flight/sim_kit.hpp"

namespace anchord::flight {
namespace {

using procedure::Step;

constexpr double k_tick_s = 0.05;    ///< of the link
constexpr double k_start_s = 12;     ///< RTK must have been fixed for ten seconds
constexpr double k_patience_s = 60;  ///< until a start that stays blocked counts
constexpr double k_again_s = 5;      ///< what was refused is read first
constexpr int k_presses = 5;  ///< on a poor link a start may not be confirmed: the operator presses again
const Eigen::Vector3d k_home_m{-9, -9, 0};

sim::AutopilotOptions autopilot_of(const sim::World& world, const ClosedLoopOptions& options) {
  auto out = options.autopilot;
  out.origin = world.origin;
  out.home_m = k_home_m;
  out.vehicle = options.vehicle;
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
      const auto unix_us = unix_us_at(now_s_);
      autopilot.advance(now_s_);
      session.feed(now_s_, unix_us, autopilot.take_bytes());
      session.tick(now_s_, unix_us);
      autopilot.feed(session.take_bytes());
    }
  }
  Now now() {
    Now out;
    out.s = now_s_;
    out.utc = UtcTime::from_us(unix_us_at(now_s_));
    out.steady = {static_cast<std::int64_t>(now_s_ * 1e9)};
    return out;
  }
  sim::AutopilotSim autopilot;
  drone::Session session;

 private:
  std::int64_t unix_us_at(double now_s) {
    return autopilot.options().start_unix_us + static_cast<std::int64_t>(now_s * 1e6);
  }
  double now_s_{0};
};

/// How near it came to what it must keep away from.
void note_place(const planning::Polygon& outline, const sim::Vehicle& vehicle, Step step,
                ClosedLoopResult& out) {
  if (!vehicle.in_air()) return;
  const Eigen::Vector3d at = vehicle.position_m();
  const double edge_m = planning::distance_to_edge_m(outline, at.head<2>());
  out.clearance_m = std::min(out.clearance_m, planning::contains(outline, at.head<2>()) ? 0 : edge_m);
  if (step != Step::take_off && step != Step::landing && step != Step::done)
    out.lowest_m = std::min(out.lowest_m, at.z());
}

}  // namespace

Result<Plan> plan_from_outline(const sim::World& world) {
  Plan plan;
  plan.name = "From the outline";
  plan.origin = world.origin;
  plan.building_height_m = world.height_m;
  const EnuFrame frame(world.origin);
  for (const auto& [x, y] :
       {std::pair{0.0, 0.0}, {world.length_m, 0.0}, {world.length_m, world.width_m}, {0.0, world.width_m}}) {
    const auto at = frame.wgs84_from_enu(Enu{{x, y, 0}});
    plan.outline.push_back({at.lon_deg, at.lat_deg});
  }
  plan.settings.max_height_m = world.height_m + 6;
  // A longer stay at each point is hardly worth its time: 4 s bring a millimetre (docs/flying.md).
  plan.settings.dwell_s = 0.5;
  plan.settings.samples = 2;
  plan.settings.max_flight_s = 1500;
  plan.settings.min_battery = 0.15;
  BOOST_OUTCOME_TRY(auto made, planning::generate_waypoints(plan));
  return std::move(made.plan);
}

sim::World walled_world() {
  sim::World world = sim::demonstration_world();
  for (auto& panel : world.panels) {
    if (panel.material.name != sim::k_glass.name) continue;
    panel.material = sim::k_brick;
    panel.thickness_m = 0.22;  // as the piers
  }
  return world;
}

Result<ClosedLoopResult> fly_closed_loop(const sim::World& world, const Plan& plan,
                                         const ClosedLoopOptions& options) {
  const auto begun = std::chrono::steady_clock::now();
  const planning::Polygon outline{
      {0, 0}, {world.length_m, 0}, {world.length_m, world.width_m}, {0, world.width_m}};
  Air air(autopilot_of(world, options));
  SimKit kit(world, options.radio, options.seed);
  InlineFlight flight({kit.mission(), plan, options.live_update_s, options.use_priors}, air.session);
  ClosedLoopResult out;
  out.data.mission = kit.mission();
  bool flew = false;
  int presses = 0;
  double press_s = k_start_s;
  while (kit.now_s() < options.max_s) {
    const auto& vehicle = air.autopilot.vehicle();
    const Eigen::Vector3d before = vehicle.position_m();
    air.fly_until(kit.now_s() + SimKit::k_step_s);
    const auto measured = kit.observe(before, vehicle);
    flight.step(air.now(), measured.fixes, measured.ranges);
    std::ranges::copy(measured.fixes, std::back_inserter(out.data.fixes));
    std::ranges::copy(measured.ranges, std::back_inserter(out.data.ranges));
    for (auto& line : flight.take_log()) out.log.emplace_back(kit.now_s(), std::move(line));
    const auto& f = flight.flight();
    const Step step = f ? f->control.engine().state().step : Step::ready;
    note_place(outline, vehicle, step, out);
    flew = flew || vehicle.in_air();
    if (f && f->flying()) continue;
    if (flew || presses == k_presses) break;
    if (kit.now_s() < press_s) continue;
    const auto started = flight.start(air.now());
    if (started) {
      ++presses;
      press_s = kit.now_s() + k_again_s;
    }
    if (!started && kit.now_s() > k_start_s + k_patience_s) return started.error();
  }
  flight.finish();
  for (const auto& anchor : world.anchors) out.data.anchor_names[anchor.id] = to_string(anchor.id);
  if (const auto& f = flight.flight()) {
    out.state = f->control.engine().state();
    if (options.use_priors) out.priors = procedure::priors_in(f->priors(), EnuFrame(*plan.origin));
  }
  out.landed = !air.autopilot.vehicle().in_air() && out.state.step == Step::done;
  out.home_m = (air.autopilot.vehicle().position_m() - k_home_m).head<2>().norm();
  out.live = flight.live().estimates();
  out.flight_s = kit.now_s();
  out.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return out;
}

FlightData fly_ring(const sim::World& world, double duration_s, const std::vector<double>& heights_m,
                    const ClosedLoopOptions& options) {
  const planning::Polygon outline{
      {0, 0}, {world.length_m, 0}, {world.length_m, world.width_m}, {0, world.width_m}};
  std::vector<Eigen::Vector3d> path;
  for (const double height : heights_m) {
    for (const auto& p : planning::ring_around(outline, 5, 2)) path.emplace_back(p.x(), p.y(), height);
  }
  sim::Vehicle vehicle(options.vehicle, k_home_m, 0);
  SimKit kit(world, options.radio, options.seed);
  vehicle.arm();
  vehicle.take_off(heights_m.front());
  FlightData data;
  data.mission = kit.mission();
  std::size_t next = 0;
  while (kit.now_s() < duration_s) {
    const auto& to = path[next % path.size()];
    if ((vehicle.position_m() - to).norm() < 1.5) ++next;
    const Eigen::Vector3d way = to - vehicle.position_m();
    vehicle.go_to(to, std::atan2(way.x(), way.y()));
    auto measured = kit.advance(vehicle);
    for (auto& fix : measured.fixes) data.fixes.push_back(std::move(fix));
    for (auto& range : measured.ranges) data.ranges.push_back(std::move(range));
  }
  for (const auto& anchor : world.anchors) data.anchor_names[anchor.id] = to_string(anchor.id);
  return data;
}

std::vector<AnchorError> assess(const sim::World& world, const FlightSolution& solution) {
  constexpr double k_chi2_95 = 7.815;
  std::vector<AnchorError> out;
  for (const auto& anchor : world.anchors) {
    AnchorError judged;
    judged.anchor = anchor.id;
    judged.error_m = std::numeric_limits<double>::infinity();
    judged.verdict = Verdict::too_few;
    for (const auto& s : solution.anchors) {
      if (s.estimate.anchor != anchor.id) continue;
      judged.verdict = s.estimate.verdict;
      if (!s.estimate.best) continue;
      const Eigen::Vector3d truth = anchor.enu_m;
      const Eigen::Vector3d error = s.estimate.best->position.m - truth;
      judged.error_m = error.norm();
      judged.inside = error.dot(s.estimate.best->covariance_m2.ldlt().solve(error)) <= k_chi2_95;
    }
    out.push_back(judged);
  }
  return out;
}

double median_error_m(std::vector<AnchorError> judged) {
  std::sort(judged.begin(), judged.end(),
            [](const AnchorError& a, const AnchorError& b) { return a.error_m < b.error_m; });
  const std::size_t n = judged.size();
  return n == 0 ? std::numeric_limits<double>::infinity()
                : (judged[(n - 1) / 2].error_m + judged[n / 2].error_m) / 2;
}

}  // namespace anchord::flight
