// Time per candidate of the planner: a grid of 41^3 candidates after 1000 measured points. CPU time, one
// thread; `rebuild_and_invert` is what eq 8.2-8.5 say word for word, on a sample of the grid.
#include <benchmark/benchmark.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "core/planning/gdop.hpp"
#include "core/planning/grid.hpp"
#include "core/planning/next_point.hpp"

namespace {

using namespace anchord::planning;
using Eigen::Vector3d;

const Vector3d k_anchor{1, 2, 3};

std::vector<Vector3d> past(std::size_t count) {
  std::vector<Vector3d> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = 2.399963 * static_cast<double>(i);  // golden angle: any count goes all the way round
    out.push_back({20 * std::cos(angle), 20 * std::sin(angle), 2 + 0.01 * static_cast<double>(i)});
  }
  return out;
}

Grid grid_41() { return grid_around({20, 0, 8}, {0.5, 0.5, 20, 20}).value(); }

void per_candidate(benchmark::State& state, std::size_t count) {
  state.counters["per_candidate"] =
      benchmark::Counter(static_cast<double>(count) * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void batch_kernel(benchmark::State& state) {
  const auto points = past(1000);
  const Geometry<3> base(k_anchor, points);
  const auto grid = grid_41();
  std::vector<double> traces(grid.size());
  for (auto _ : state) {
    traces_with(base, grid.x_m, grid.y_m, grid.z_m, traces);
    benchmark::DoNotOptimize(traces.data());
    benchmark::ClobberMemory();
  }
  per_candidate(state, grid.size());
}

void base_built_anew_then_batch(benchmark::State& state) {
  const auto points = past(1000);
  const auto grid = grid_41();
  std::vector<double> traces(grid.size());
  for (auto _ : state) {
    const Geometry<3> base(k_anchor, points);
    traces_with(base, grid.x_m, grid.y_m, grid.z_m, traces);
    benchmark::DoNotOptimize(traces.data());
    benchmark::ClobberMemory();
  }
  per_candidate(state, grid.size());
}

void rebuild_and_invert(benchmark::State& state) {
  const auto points = past(1000);
  const auto grid = grid_41();
  constexpr std::size_t k_sample = 50;
  for (auto _ : state) {
    for (std::size_t i = 0; i < k_sample; ++i) {
      Eigen::Matrix<double, Eigen::Dynamic, 3> m(static_cast<Eigen::Index>(points.size() + 1), 3);
      for (std::size_t k = 0; k < points.size(); ++k) {
        m.row(static_cast<Eigen::Index>(k)) = (points[k] - k_anchor).normalized().transpose();
      }
      m.bottomRows<1>() = (grid.at(i * 1000) - k_anchor).normalized().transpose();
      const Eigen::Matrix3d normal = m.transpose() * m;
      benchmark::DoNotOptimize(normal.inverse().trace());
    }
  }
  per_candidate(state, k_sample);
}

/// The whole decision with refusals and words, as `anchord plan next` makes it.
void whole_decision(benchmark::State& state) {
  NextPointInput input;
  input.visited = past(1000);
  input.anchors = {{"a", {{k_anchor, 1}}, {}}};
  for (std::size_t i = 0; i < input.visited.size(); ++i) input.anchors[0].measured_at.push_back(i);
  input.current = Vector3d{20, 0, 8};
  NextPointOptions options;
  options.grid = {0.5, 0.5, static_cast<int>(state.range(0)), static_cast<int>(state.range(0))};
  std::size_t count = 0;
  for (auto _ : state) {
    const auto decision = next_point(input, options).value();
    count = decision.candidates.size();
    benchmark::DoNotOptimize(decision.chosen);
  }
  per_candidate(state, count);
}

BENCHMARK(batch_kernel)->Unit(benchmark::kMicrosecond);
BENCHMARK(base_built_anew_then_batch)->Unit(benchmark::kMicrosecond);
BENCHMARK(rebuild_and_invert)->Unit(benchmark::kMicrosecond);
BENCHMARK(whole_decision)->Arg(1)->Arg(5)->Arg(20)->Unit(benchmark::kMicrosecond);

}  // namespace
