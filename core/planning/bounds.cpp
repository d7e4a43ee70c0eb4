#include "core/planning/bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/cross.hpp"

namespace anchord::planning {
namespace {

using Eigen::Vector2d;

/// A way that runs along a keep-out distance is legal; rounding must not turn it into one that is not.
constexpr double k_slack_m = 1e-9;

int side_of(const Vector2d& a, const Vector2d& b, const Vector2d& p) {
  const double value = cross(b - a, p - a);
  return (value > 0) - (value < 0);
}

bool in_box(const Vector2d& a, const Vector2d& b, const Vector2d& p) {
  return p.x() >= std::min(a.x(), b.x()) && p.x() <= std::max(a.x(), b.x()) &&
         p.y() >= std::min(a.y(), b.y()) && p.y() <= std::max(a.y(), b.y());
}

template <class Visit>
void for_each_edge(const Polygon& polygon, Visit&& visit) {
  for (std::size_t i = 0; i < polygon.size(); ++i) visit(polygon[i], polygon[(i + 1) % polygon.size()]);
}

/// No two points of the boxes round two segments are nearer than this.
double box_gap_m(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const Vector2d gap = (a.cwiseMin(b) - c.cwiseMax(d)).cwiseMax(c.cwiseMin(d) - a.cwiseMax(b));
  return gap.cwiseMax(0.0).norm();
}

bool crosses_edge(const Polygon& polygon, const Vector2d& from, const Vector2d& to) {
  bool out = false;
  for_each_edge(polygon,
                [&](const Vector2d& a, const Vector2d& b) { out = out || segments_cross(from, to, a, b); });
  return out;
}

/// A polygon may be concave: both ends inside do not make the way between them inside. Cuts the way where it
/// meets edges and asks for the middle of every piece. A way that begins outside may come in, once.
bool way_stays_inside(const Polygon& polygon, const Vector2d& from, const Vector2d& to) {
  std::vector<double> cuts{0, 1};
  const Vector2d way = to - from;
  for_each_edge(polygon, [&](const Vector2d& a, const Vector2d& b) {
    const double parallel = cross(way, b - a);
    if (parallel != 0) cuts.push_back(std::clamp(cross(a - from, b - a) / parallel, 0.0, 1.0));
    for (const auto& corner : {a, b}) {  // for edges along the way
      if (way.squaredNorm() > 0)
        cuts.push_back(std::clamp((corner - from).dot(way) / way.squaredNorm(), 0.0, 1.0));
    }
  });
  std::sort(cuts.begin(), cuts.end());
  bool came_in = contains(polygon, from);
  for (std::size_t i = 1; i < cuts.size(); ++i) {
    if (cuts[i] - cuts[i - 1] < 1e-12) continue;
    const bool inside = contains(polygon, from + 0.5 * (cuts[i] + cuts[i - 1]) * way);
    if (came_in && !inside) return false;
    came_in = came_in || inside;
  }
  return contains(polygon, to);
}

/// Nearer than allowed somewhere on the way, and not merely on the way out of where it already was too near.
bool comes_too_near(double start_m, double end_m, double way_m, double keep_out_m) {
  if (way_m >= keep_out_m - k_slack_m) return false;
  const bool started_inside = start_m < keep_out_m - k_slack_m;
  return !started_inside || end_m < start_m || way_m < start_m - k_slack_m;
}

}  // namespace

bool contains(const Polygon& polygon, const Vector2d& point) {
  if (polygon.size() < 3) return false;
  bool inside = false, on_edge = false;
  for_each_edge(polygon, [&](const Vector2d& a, const Vector2d& b) {
    on_edge = on_edge || (side_of(a, b, point) == 0 && in_box(a, b, point));
    // Half-open in y, so that a ray through a corner counts one of its two edges.
    if ((a.y() > point.y()) != (b.y() > point.y()) &&
        point.x() < (b.x() - a.x()) * (point.y() - a.y()) / (b.y() - a.y()) + a.x()) {
      inside = !inside;
    }
  });
  return inside || on_edge;
}

bool segments_cross(const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d) {
  const int a_side = side_of(c, d, a), b_side = side_of(c, d, b), c_side = side_of(a, b, c),
            d_side = side_of(a, b, d);
  if (a_side * b_side < 0 && c_side * d_side < 0) return true;
  return (a_side == 0 && in_box(c, d, a)) || (b_side == 0 && in_box(c, d, b)) ||
         (c_side == 0 && in_box(a, b, c)) || (d_side == 0 && in_box(a, b, d));
}

double distance_to_segment_m(const Vector2d& point, const Vector2d& a, const Vector2d& b) {
  const Vector2d ab = b - a;
  const double squared = ab.squaredNorm();
  const double t = squared > 0 ? std::clamp((point - a).dot(ab) / squared, 0.0, 1.0) : 0.0;
  return (point - (a + t * ab)).norm();
}

double distance_between_segments_m(const Vector2d& a, const Vector2d& b, const Vector2d& c,
                                   const Vector2d& d) {
  if (segments_cross(a, b, c, d)) return 0;
  return std::min({distance_to_segment_m(a, c, d), distance_to_segment_m(b, c, d),
                   distance_to_segment_m(c, a, b), distance_to_segment_m(d, a, b)});
}

double distance_to_edge_m(const Polygon& polygon, const Vector2d& point) {
  double out = std::numeric_limits<double>::infinity();
  for_each_edge(polygon, [&](const Vector2d& a, const Vector2d& b) {
    out = std::min(out, distance_to_segment_m(point, a, b));
  });
  return out;
}

bool crosses_itself(const Polygon& polygon) {
  const std::size_t n = polygon.size();
  if (n > 2000) return false;  // the square of it would take seconds
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 2; j < n; ++j) {
      if (i == 0 && j + 1 == n) continue;
      const auto &a = polygon[i], &b = polygon[(i + 1) % n], &c = polygon[j], &d = polygon[(j + 1) % n];
      if (side_of(a, b, c) * side_of(a, b, d) < 0 && side_of(c, d, a) * side_of(c, d, b) < 0) return true;
    }
  }
  return false;
}

bool covers(const Polygon& outer, const Polygon& inner, double slack_m) {
  constexpr double k_step_m = 0.5;
  bool all = outer.size() >= 3 && !inner.empty();
  for_each_edge(inner, [&](const Vector2d& a, const Vector2d& b) {
    const int steps = std::clamp(static_cast<int>((b - a).norm() / k_step_m) + 1, 1, 10'000);
    for (int k = 0; k < steps && all; ++k) {
      const Vector2d at = a + (b - a) * (static_cast<double>(k) / steps);
      all = contains(outer, at) || distance_to_edge_m(outer, at) <= slack_m;
    }
  });
  return all;
}

std::optional<Refusal> refuse_point(const Bounds& bounds, const Eigen::Vector3d& point_m) {
  if (!point_m.allFinite()) return Refusal::outside_fence;
  const Vector2d p = point_m.head<2>();
  if (!bounds.fence.empty() && !contains(bounds.fence, p)) return Refusal::outside_fence;
  for (const auto& area : bounds.no_fly) {
    if (contains(area, p) || distance_to_edge_m(area, p) < bounds.keep_out_m - k_slack_m)
      return Refusal::no_fly;
  }
  for (const auto& wall : bounds.walls) {
    const double m = distance_to_segment_m(p, wall.a_m, wall.b_m);
    if (m == 0 || m < wall.keep_out_m - k_slack_m) return Refusal::near_wall;
  }
  if (bounds.min_height_m && point_m.z() < *bounds.min_height_m) return Refusal::too_low;
  if (bounds.max_height_m && point_m.z() > *bounds.max_height_m) return Refusal::too_high;
  return std::nullopt;
}

std::optional<Refusal> refuse_path(const Bounds& bounds, const Eigen::Vector3d& from_m,
                                   const Eigen::Vector3d& to_m) {
  const Vector2d from = from_m.head<2>(), to = to_m.head<2>();
  if (!bounds.fence.empty() && !way_stays_inside(bounds.fence, from, to)) {
    return Refusal::path_blocked;
  }
  for (const auto& area : bounds.no_fly) {
    if (!contains(area, from) && (contains(area, to) || crosses_edge(area, from, to)))
      return Refusal::path_blocked;
    double way = std::numeric_limits<double>::infinity();
    for_each_edge(area, [&](const Vector2d& a, const Vector2d& b) {
      // Beyond the keep-out the exact distance decides nothing.
      if (box_gap_m(from, to, a, b) < bounds.keep_out_m)
        way = std::min(way, distance_between_segments_m(from, to, a, b));
    });
    if (comes_too_near(distance_to_edge_m(area, from), distance_to_edge_m(area, to), way,
                       bounds.keep_out_m)) {
      return Refusal::path_blocked;
    }
  }
  for (const auto& wall : bounds.walls) {
    if (segments_cross(from, to, wall.a_m, wall.b_m)) return Refusal::path_blocked;
    const double way = distance_between_segments_m(from, to, wall.a_m, wall.b_m);
    if (comes_too_near(distance_to_segment_m(from, wall.a_m, wall.b_m),
                       distance_to_segment_m(to, wall.a_m, wall.b_m), way, wall.keep_out_m)) {
      return Refusal::path_blocked;
    }
  }
  return std::nullopt;
}

double p_nlos_through(const Bounds& bounds, const Eigen::Vector3d& from_m, const Eigen::Vector3d& to_m) {
  double clear = 1;
  for (const auto& wall : bounds.walls) {
    if (wall.p_nlos > 0 && segments_cross(from_m.head<2>(), to_m.head<2>(), wall.a_m, wall.b_m)) {
      clear *= 1 - wall.p_nlos;
    }
  }
  return 1 - clear;
}

}  // namespace anchord::planning
