#include "core/planning/flight_time.hpp"

#include <algorithm>

namespace anchord::planning {
namespace {

/// Seconds of one kind of work: as it goes at best, as a rule, and in wind over a bad link. Seen on
/// closed-loop flights over MAVLink; tests/server/flight holds the forecast to them.
struct Cost {
  double low_s, expected_s, high_s;
};
constexpr Cost k_settle{1, 1.5, 2.2};  ///< braking, and standing still long enough to count as arrived
constexpr Cost k_listen{1, 1.2, 2};    ///< for the anchors of a waypoint, and the decision
constexpr Cost k_turn{16, 18, 23};     ///< four quarters
constexpr Cost k_heights{11, 13, 17};  ///< 1.5 m up, 3 m down, 1.5 m up
constexpr Cost k_ends{22, 26, 40};     ///< take-off and touch-down
constexpr double k_wind = 1.25, k_sink_mps = 0.7;
constexpr std::size_t k_anchors = 6;  ///< of a building nobody has counted them in

}  // namespace

FlightTime flight_time(const LocalPlan& local, const Plan& plan) {
  FlightTime out;
  if (local.waypoints_m.empty()) return out;
  const auto& s = plan.settings;
  const auto add = [&](const Cost& cost, double low, double expected, double high) {
    out.low_s += low * cost.low_s;
    out.expected_s += expected * cost.expected_s;
    out.high_s += high * cost.high_s;
  };
  const auto same = [&](const Cost& cost, double n) { add(cost, n, n, n); };
  double way_m = (local.waypoints_m.back() - local.waypoints_m.front()).norm();  // home lies near the first
  double n_measure = 0, dwell_s = 0;
  std::size_t n_turn = 0, n_heights = 0;
  for (std::size_t i = 0; i < plan.waypoints.size(); ++i) {
    const auto& w = plan.waypoints[i];
    if (i > 0) way_m += (local.waypoints_m[i] - local.waypoints_m[i - 1]).norm();
    if (!w.measure) continue;
    ++n_measure;
    dwell_s += w.dwell_s.value_or(s.dwell_s);
    n_turn += s.turn && w.turn ? 1 : 0;
    n_heights += s.height_search && w.height_search ? 1 : 0;
  }
  const double fly_s = way_m / s.speed_mps;
  add({1, 1, k_wind}, fly_s, fly_s, fly_s);
  add({1, 1, 1}, dwell_s, dwell_s, dwell_s);
  same(k_settle, static_cast<double>(plan.waypoints.size()));
  same(k_listen, n_measure);
  // Where an anchor is heard first: all at once at best, each at a waypoint of its own at worst.
  const std::size_t anchors = plan.expected_anchors.empty() ? k_anchors : plan.expected_anchors.size();
  const auto of = [](std::size_t n, std::size_t most) { return static_cast<double>(std::min(n, most)); };
  add(k_turn, of(n_turn, 1), of(n_turn, (anchors + 1) / 2), of(n_turn, anchors));
  add(k_heights, 0, of(n_heights, (anchors + 1) / 2), of(n_heights, anchors));
  // The planner's points beside a third of the waypoints, or half of them.
  const double beside_s = s.grid_step_m * std::max(1, s.grid_reach) / s.speed_mps + s.dwell_s;
  const Cost beside{0, beside_s + k_settle.expected_s + k_listen.expected_s + 1,
                    k_wind * beside_s + k_settle.high_s + k_listen.high_s + 1};
  add(beside, 0, n_measure / 3, n_measure / 2);
  same(k_ends, 1);
  const double sink_s = local.waypoints_m.back().z() / k_sink_mps;
  add({1, 1, 1}, 0, sink_s / 2, sink_s);
  return out;
}

}  // namespace anchord::planning
