// Time of one anchor's solve over the number of ranges, Ceres beside the Eigen Gauss-Newton of the live path,
// and of a whole simulated flight. CPU time; one thread.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
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

/// Ranges to the anchors of a campus, 50 a second, as many to each.
FlightData campus(int n_anchors, int ranges_each) {
  sim::Random random(23);
  FlightData flight;
  flight.mission.frame = TrackFrame::local;
  std::vector<Eigen::Vector3d> anchors;
  for (int a = 0; a < n_anchors; ++a)
    anchors.emplace_back(-36.0 + 8.0 * (a % 10), -24.0 + 12.0 * static_cast<double>(a / 10 % 5),
                         2.0 + 6.0 * random.uniform());
  for (int i = 0; i < n_anchors * ranges_each / 5; ++i) {
    const double turn = 0.01 * i;
    Fix fix;
    fix.frame = TrackFrame::local;
    fix.fix = FixClass::rtk_fixed;
    fix.time = UtcTime::from_seconds(0.1 * i);
    fix.local_m = {45 * std::cos(turn), 30 * std::sin(1.3 * turn), 12 + 7 * std::sin(2.1 * turn)};
    flight.fixes.push_back(fix);
    for (int k = 0; k < 5; ++k) {
      const auto a = static_cast<std::size_t>((5 * i + k) % n_anchors);
      Range range;
      range.time = fix.time;
      range.tag = NetworkId{0x6e01};
      range.anchor = NetworkId{static_cast<std::uint32_t>(0x6000 + a)};
      range.distance_m = (fix.local_m - anchors[a]).norm() + 0.05 * random.normal();
      flight.ranges.push_back(range);
    }
  }
  return flight;
}

/// 10 000 ranges to 50 anchors, in one solve with everything they share.
void solve_fifty_anchors(benchmark::State& state) {
  const FlightData flight = campus(50, 200);
  for (auto _ : state) benchmark::DoNotOptimize(solve_flight(flight).value().anchors.size());
}
BENCHMARK(solve_fifty_anchors)->Unit(benchmark::kMillisecond);

/// 1 000 ranges to each of so many anchors: a whole solve, shown an anchor.
void solve_anchors(benchmark::State& state) {
  const FlightData flight = campus(static_cast<int>(state.range(0)), 1000);
  for (auto _ : state) benchmark::DoNotOptimize(solve_flight(flight).value().anchors.size());
  state.counters["s_per_anchor"] =
      benchmark::Counter(static_cast<double>(state.range(0)),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(solve_anchors)->Arg(10)->Arg(50)->Arg(200)->Unit(benchmark::kMillisecond);

/// Time of one range through the live path, most of which only join it and some of which solve its anchor.
void live_update(benchmark::State& state) {
  const auto flight = sim::simulate_flight(sim::demonstration_world(), {}).value();
  std::vector<double> micros;
  for (auto _ : state) {
    LiveFlight live(flight.data.mission);
    std::size_t fix = 0;
    for (const Range& range : flight.data.ranges) {
      while (fix < flight.data.fixes.size() && flight.data.fixes[fix].time <= range.time)
        live.add(flight.data.fixes[fix++]);
      const auto begin = std::chrono::steady_clock::now();
      live.add(range);
      benchmark::DoNotOptimize(live.take_estimates().size() + live.take_ranges().size());
      micros.push_back(
          std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - begin).count());
    }
  }
  std::ranges::sort(micros);
  state.counters["p50_us"] = micros[micros.size() / 2];
  state.counters["p99_us"] = micros[micros.size() * 99 / 100];
}
BENCHMARK(live_update)->Unit(benchmark::kMillisecond);

}  // namespace
