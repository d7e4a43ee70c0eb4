// Time of one anchor's solve over the number of ranges, Ceres beside the Eigen Gauss-Newton of the live path,
// and of a whole simulated flight. CPU time; one thread.
#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "core/localize/flight_solver.hpp"
#include "core/localize/live_flight.hpp"
#include "core/localize/solver.hpp"
#include "drivers/sim/flight.hpp"

namespace {

using namespace anchord;

/// Ranges to (3, 4, 2) from a ring of 20 m at changing height, noise of 5 cm, RTK covariance of 1 cm.
std::vector<Observation> ring(std::int64_t count) {
  sim::Random random(17);
  std::vector<Observation> rows;
  for (std::int64_t i = 0; i < count; ++i) {
    const double angle = 2.399963 * static_cast<double>(i);  // golden angle: any count goes all the way round
    Observation row;
    row.tag_m = {20 * std::cos(angle), 20 * std::sin(angle), 3 + 10 * random.uniform()};
    row.distance_m = (row.tag_m - Eigen::Vector3d(3, 4, 2)).norm() + 0.05 * random.normal();
    row.sigma_m = 0.05;
    row.tag_covariance_m2 = Eigen::Matrix3d::Identity() * 1e-4;
    rows.push_back(row);
  }
  return rows;
}

void solve_ceres(benchmark::State& state) {
  const auto rows = ring(state.range(0));
  for (auto _ : state) benchmark::DoNotOptimize(solve_anchor(rows, {0, 0, 0}).value().position_m);
}
void solve_gauss_newton(benchmark::State& state) {
  const auto rows = ring(state.range(0));
  for (auto _ : state)
    benchmark::DoNotOptimize(solve_anchor_gauss_newton(rows, {0, 0, 0}).value().position_m);
}
BENCHMARK(solve_ceres)->RangeMultiplier(10)->Range(10, 10'000)->Unit(benchmark::kMicrosecond);
BENCHMARK(solve_gauss_newton)->RangeMultiplier(10)->Range(10, 10'000)->Unit(benchmark::kMicrosecond);

/// Six anchors and 3 700 ranges at once, with everything they share.
void solve_whole_flight(benchmark::State& state) {
  const auto flight = sim::simulate_flight(sim::demonstration_world(), {}).value();
  for (auto _ : state) benchmark::DoNotOptimize(solve_flight(flight.data).value().anchors.size());
}
BENCHMARK(solve_whole_flight)->Unit(benchmark::kMillisecond);

/// The same flight through the live path: every range joined, its anchor solved twice a second of flight.
void live_whole_flight(benchmark::State& state) {
  const auto flight = sim::simulate_flight(sim::demonstration_world(), {}).value();
  for (auto _ : state) {
    LiveFlight live(flight.data.mission);
    std::size_t fix = 0;
    for (const Range& range : flight.data.ranges) {
      while (fix < flight.data.fixes.size() && flight.data.fixes[fix].time <= range.time)
        live.add(flight.data.fixes[fix++]);
      live.add(range);
      benchmark::DoNotOptimize(live.take_estimates().size() + live.take_ranges().size());
    }
  }
  state.counters["cpu_s_per_flight_s"] =
      benchmark::Counter(210.0, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(live_whole_flight)->Unit(benchmark::kMillisecond);

}  // namespace
