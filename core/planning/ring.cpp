#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/planning/flight_plan.hpp"

namespace anchord::planning {
namespace {

using Eigen::Vector2d;

double signed_area(const Polygon& polygon) {
  double twice = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    twice += a.x() * b.y() - a.y() * b.x();
  }
  return twice / 2;
}

Vector2d outward(const Vector2d& a, const Vector2d& b) {  // of a counter-clockwise edge
  const Vector2d d = (b - a).normalized();
  return {d.y(), -d.x()};
}

}  // namespace

/// Every edge moved outwards, and an arc round every corner that points outwards; what then lies too near to
/// another part of the outline (the inside of an L) is left out. No polygon clipping needed.
std::vector<Vector2d> ring_around(const Polygon& polygon, double distance_m, double spacing_m) {
  Polygon corners = polygon;
  if (signed_area(corners) < 0) std::reverse(corners.begin(), corners.end());
  std::vector<Vector2d> out;
  // A finely drawn curve would give a point every few centimetres; chords of this length stay shallow.
  const double least_m = std::min(0.3 * distance_m, 0.5 * spacing_m);
  const auto keep = [&](const Vector2d& p) {
    if (!out.empty() && (p - out.back()).norm() < least_m) return;
    if (!contains(polygon, p) && distance_to_edge_m(polygon, p) >= distance_m - 1e-6) out.push_back(p);
  };
  const std::size_t n = corners.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2d &a = corners[i], &b = corners[(i + 1) % n], &c = corners[(i + 2) % n];
    if ((b - a).norm() < 1e-9 || (c - b).norm() < 1e-9) continue;
    const Vector2d normal = outward(a, b);
    const int steps = std::max(1, static_cast<int>(std::ceil((b - a).norm() / spacing_m)));
    for (int k = 0; k <= steps; ++k)
      keep(a + (b - a) * (static_cast<double>(k) / steps) + distance_m * normal);
    const Vector2d next = outward(b, c);
    const double turn = std::atan2(normal.x() * next.y() - normal.y() * next.x(), normal.dot(next));
    // However sharp the corner, no chord cuts deep into the arc.
    constexpr double k_largest_step_rad = 0.6;
    const int arc =
        turn > 0 ? static_cast<int>(std::max(turn * distance_m / spacing_m, turn / k_largest_step_rad)) : 0;
    for (int k = 1; k <= arc; ++k) {
      const double angle = turn * k / (arc + 1), co = std::cos(angle), si = std::sin(angle);
      keep(b + distance_m * Vector2d(co * normal.x() - si * normal.y(), si * normal.x() + co * normal.y()));
    }
  }
  return out;
}

}  // namespace anchord::planning
