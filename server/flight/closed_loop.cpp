#include "server/flight/closed_loop.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>

#include "core/geo/enu.hpp"
#include "core/localize/live_flight.hpp"
#include "core/planning/flight_plan.hpp"
#include "core/planning/local_plan.hpp"
#include "server/flight/sim_kit.hpp"

namespace anchord::flight {
namespace {

using procedure::Command;
using procedure::Event;

const Eigen::Vector3d k_home_m{-9, -9, 0};

void obey(sim::Vehicle& vehicle, const Command& order) {
  switch (order.kind) {
    case Command::Kind::take_off:
      vehicle.arm();
      return vehicle.take_off(order.point_m.z());
    case Command::Kind::go_to:
      return vehicle.go_to(order.point_m, order.heading_rad);
    case Command::Kind::hold:
      return vehicle.hold();
    case Command::Kind::return_home:
      return vehicle.return_home();
    case Command::Kind::land:
      return vehicle.land();
    case Command::Kind::measure:
    case Command::Kind::decide:
      return;
  }
}

procedure::VehicleView view_of(const sim::Vehicle& vehicle) {
  procedure::VehicleView view;
  view.position_m = vehicle.position_m();
  view.heading_rad = vehicle.heading_rad();
  view.speed_mps = vehicle.velocity_mps().norm();
  view.armed = vehicle.armed();
  view.in_air = vehicle.in_air();
  view.battery = vehicle.battery();
  return view;
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
  // Hovering sees one geometry again and again, walls included; the way between the points sees many.
  plan.settings.dwell_s = 0.5;
  plan.settings.samples = 2;
  plan.settings.max_flight_s = 1500;
  plan.settings.min_battery = 0.15;
  return planning::generate_waypoints(plan);
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
  BOOST_OUTCOME_TRY(auto setup, procedure::flight_setup(plan, k_home_m));
  setup.limits.battery_per_s = 1 / options.vehicle.battery_s;
  const auto begun = std::chrono::steady_clock::now();
  const EnuFrame frame(setup.origin);
  sim::Vehicle vehicle(options.vehicle, k_home_m, 0);
  SimKit kit(world, options.radio, options.seed);
  procedure::FlightEngine engine(std::move(setup));
  LiveOptions live_options;
  live_options.origin = frame.origin();
  live_options.update_interval_s = options.live_update_s;
  LiveFlight live(kit.mission(), live_options);
  ClosedLoopResult out;
  out.data.mission = kit.mission();
  bool started = false;
  std::uint64_t n_decided = 0, n_clues = 0;
  while (kit.now_s() < options.max_s) {
    auto measured = kit.advance(vehicle);
    const double now = kit.now_s();
    engine.vehicle(now, view_of(vehicle));
    for (auto& fix : measured.fixes) {
      engine.fix(now, frame.enu_from_wgs84(fix.position).m, fix.fix);
      live.add(fix);
      out.data.fixes.push_back(std::move(fix));
    }
    for (auto& range : measured.ranges) {
      live.add(range);
      out.data.ranges.push_back(std::move(range));
    }
    for (const auto& result : live.take_ranges())
      engine.range(now, result.range.anchor, result.used(), result.range.rss_dbm, result.range.distance_m);
    if (options.use_clues && n_clues != engine.clues_version()) {
      n_clues = engine.clues_version();
      out.clues = procedure::clues_in(procedure::flight_clues(engine.clues(), frame), frame);
      live.tell(out.clues);
    }
    if (!started && now > 2) started = engine.command(now, Event::start, "the simulation");
    const bool deciding = engine.state().step == procedure::Step::find_next_point;
    engine.tick(now, deciding ? live.estimates() : std::vector<Estimate>{});
    if (deciding) ++n_decided;
    for (const auto& order : engine.take_orders()) {
      obey(vehicle, order);
      ++out.n_orders;
    }
    for (auto& h : engine.take_happenings()) out.happenings.push_back(std::move(h));
    if (engine.state().step == procedure::Step::done) break;
  }
  for (const auto& anchor : world.anchors) out.data.anchor_names[anchor.id] = to_string(anchor.id);
  live.finish();
  out.live = live.estimates();
  out.state = engine.state();
  out.n_decisions = n_decided;
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

FlightData thinned_at_rest(FlightData data) {
  constexpr double k_step_m = 0.3;
  if (data.fixes.empty()) return data;
  const EnuFrame frame(data.fixes.front().position);
  std::map<NetworkId, Eigen::Vector3d> kept_at_m;
  std::vector<Range> kept;
  std::size_t next = 0;  // both are in order of time
  for (auto& range : data.ranges) {
    while (next + 1 < data.fixes.size() && data.fixes[next].time < range.time) ++next;
    const Eigen::Vector3d here_m = frame.enu_from_wgs84(data.fixes[next].position).m;
    const auto before = kept_at_m.find(range.anchor);
    if (before != kept_at_m.end() && (before->second - here_m).norm() < k_step_m) continue;
    kept_at_m[range.anchor] = here_m;
    kept.push_back(std::move(range));
  }
  data.ranges = std::move(kept);
  return data;
}

std::vector<Judged> judge(const sim::World& world, const FlightSolution& solution) {
  constexpr double k_chi2_95 = 7.815;
  std::vector<Judged> out;
  for (const auto& anchor : world.anchors) {
    Judged judged;
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

double median_error_m(std::vector<Judged> judged) {
  std::sort(judged.begin(), judged.end(),
            [](const Judged& a, const Judged& b) { return a.error_m < b.error_m; });
  const std::size_t n = judged.size();
  return n == 0 ? std::numeric_limits<double>::infinity()
                : (judged[(n - 1) / 2].error_m + judged[n / 2].error_m) / 2;
}

}  // namespace anchord::flight
