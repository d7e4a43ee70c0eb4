#include "core/planning/route.hpp"

#include <algorithm>
#include <limits>

#include "core/planning/flight_plan.hpp"

namespace anchord::planning {
namespace {

constexpr double k_margin_m =
    0.5;  ///< beyond the keep-out, so that legs between turning points do not graze it
constexpr double k_spacing_m = 6;  ///< of turning points along a side
constexpr std::size_t k_max_nodes = 400;

void add_ring(const Bounds& bounds, const Polygon& polygon, double distance_m, double height_m,
              std::vector<Eigen::Vector3d>& nodes) {
  for (const auto& p : ring_around(polygon, distance_m, k_spacing_m)) {
    const Eigen::Vector3d node{p.x(), p.y(), height_m};
    if (nodes.size() < k_max_nodes && !refuse_point(bounds, node)) nodes.push_back(node);
  }
}

}  // namespace

std::optional<std::vector<Eigen::Vector3d>> route(const Bounds& bounds, const Eigen::Vector3d& from_m,
                                                  const Eigen::Vector3d& to_m) {
  if (refuse_point(bounds, to_m)) return std::nullopt;
  if (!refuse_path(bounds, from_m, to_m)) return std::vector{to_m};
  double height_m = std::max(from_m.z(), to_m.z());
  if (bounds.max_height_m) height_m = std::min(height_m, *bounds.max_height_m);
  if (bounds.min_height_m) height_m = std::max(height_m, *bounds.min_height_m);
  std::vector<Eigen::Vector3d> nodes{from_m, to_m};
  for (const auto& area : bounds.no_fly)
    add_ring(bounds, area, bounds.keep_out_m + k_margin_m, height_m, nodes);
  for (const auto& wall : bounds.walls) {
    const Eigen::Vector2d along = (wall.b_m - wall.a_m).normalized() * 0.01, across{-along.y(), along.x()};
    const Polygon thin{wall.a_m - across, wall.b_m - across, wall.b_m + across, wall.a_m + across};
    add_ring(bounds, thin, std::max(wall.keep_out_m, 0.1) + k_margin_m, height_m, nodes);
  }

  // Dijkstra; the graph is dense, so the nearest open node is found by looking at all.
  constexpr double k_far = std::numeric_limits<double>::infinity();
  std::vector<double> length_m(nodes.size(), k_far);
  std::vector<std::size_t> before(nodes.size(), 0);
  std::vector<bool> closed(nodes.size(), false);
  length_m[0] = 0;
  while (true) {
    std::size_t here = nodes.size();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (!closed[i] && length_m[i] < k_far && (here == nodes.size() || length_m[i] < length_m[here]))
        here = i;
    }
    if (here == nodes.size()) return std::nullopt;
    if (here == 1) break;
    closed[here] = true;
    for (std::size_t next = 1; next < nodes.size(); ++next) {
      const double to_there_m = length_m[here] + (nodes[next] - nodes[here]).norm();
      if (closed[next] || to_there_m >= length_m[next] || refuse_path(bounds, nodes[here], nodes[next]))
        continue;
      length_m[next] = to_there_m;
      before[next] = here;
    }
  }
  std::vector<Eigen::Vector3d> way;
  for (std::size_t at = 1; at != 0; at = before[at]) way.push_back(nodes[at]);
  std::reverse(way.begin(), way.end());
  return way;
}

}  // namespace anchord::planning
