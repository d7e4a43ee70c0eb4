// Polygons of the planner beside Boost.Geometry: an outline of 12 corners asked at 10 000 points and ways, as
// a decision does. CPU time, one thread. Why the own functions stay: docs/adr/0008-polygons.md.
#include <benchmark/benchmark.h>

#include <boost/geometry.hpp>
#include <boost/geometry/geometries/linestring.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>
#include <numbers>
#include <random>
#include <vector>

#include "core/planning/bounds.hpp"

namespace {

namespace bg = boost::geometry;
using anchord::planning::Polygon;
using BoostPoint = bg::model::d2::point_xy<double>;
using BoostPolygon = bg::model::polygon<BoostPoint>;
using BoostLine = bg::model::linestring<BoostPoint>;
using Eigen::Vector2d;

constexpr std::size_t k_points = 10'000;

/// A star of 12 corners: concave, as buildings are.
Polygon outline() {
  Polygon out;
  for (int i = 0; i < 12; ++i) {
    const double angle = 2 * std::numbers::pi * i / 12, radius_m = i % 2 == 0 ? 20 : 12;
    out.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle));
  }
  return out;
}

std::vector<Vector2d> points() {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> metre(-25, 25);
  std::vector<Vector2d> out(k_points);
  for (auto& p : out) p = {metre(random), metre(random)};
  return out;
}

BoostPoint boost_point(const Vector2d& p) { return {p.x(), p.y()}; }

BoostPolygon boost_outline() {
  BoostPolygon out;
  for (const auto& corner : outline()) bg::append(out.outer(), boost_point(corner));
  bg::correct(out);
  return out;
}

template <class Ask>
void run(benchmark::State& state, Ask ask) {
  const auto asked = points();
  double sum = 0;
  for (auto _ : state) {
    for (std::size_t i = 1; i < asked.size(); ++i) sum += static_cast<double>(ask(asked[i - 1], asked[i]));
    benchmark::DoNotOptimize(sum);
  }
  state.counters["per_call"] =
      benchmark::Counter(static_cast<double>(k_points) * static_cast<double>(state.iterations()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void contains_own(benchmark::State& state) {
  run(state, [area = outline()](const Vector2d&, const Vector2d& p) {
    return anchord::planning::contains(area, p);
  });
}
void contains_boost(benchmark::State& state) {
  run(state, [area = boost_outline()](const Vector2d&, const Vector2d& p) {
    return bg::covered_by(boost_point(p), area);
  });
}
void distance_to_edge_own(benchmark::State& state) {
  run(state, [area = outline()](const Vector2d&, const Vector2d& p) {
    return anchord::planning::distance_to_edge_m(area, p);
  });
}
void distance_to_edge_boost(benchmark::State& state) {
  BoostLine edge;
  for (const auto& corner : boost_outline().outer()) bg::append(edge, corner);
  run(state, [edge](const Vector2d&, const Vector2d& p) { return bg::distance(boost_point(p), edge); });
}
void way_crosses_own(benchmark::State& state) {
  run(state, [area = outline()](const Vector2d& a, const Vector2d& b) {
    bool out = false;
    for (std::size_t i = 0; i < area.size(); ++i)
      out = out || anchord::planning::segments_cross(a, b, area[i], area[(i + 1) % area.size()]);
    return out;
  });
}
void way_crosses_boost(benchmark::State& state) {
  BoostLine edge;
  for (const auto& corner : boost_outline().outer()) bg::append(edge, corner);
  run(state, [edge](const Vector2d& a, const Vector2d& b) {
    return bg::intersects(bg::model::segment<BoostPoint>(boost_point(a), boost_point(b)), edge);
  });
}

BENCHMARK(contains_own);
BENCHMARK(contains_boost);
BENCHMARK(distance_to_edge_own);
BENCHMARK(distance_to_edge_boost);
BENCHMARK(way_crosses_own);
BENCHMARK(way_crosses_boost);

}  // namespace
