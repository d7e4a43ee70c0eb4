#include "drivers/sim/world.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>

namespace anchord::sim {
namespace {

/// Absolute cosine between the line and the panel's normal where they cross; nothing when they do not.
std::optional<double> crossing(const Panel& panel, const Eigen::Vector3d& from_m,
                               const Eigen::Vector3d& step_m) {
  const Eigen::Vector3d normal = panel.side_a_m.cross(panel.side_b_m).normalized();
  const double along = normal.dot(step_m);
  if (std::abs(along) < 1e-12) return std::nullopt;
  const double share = normal.dot(panel.corner_m - from_m) / along;
  if (share <= 0 || share >= 1) return std::nullopt;
  const Eigen::Vector3d in_panel_m = from_m + share * step_m - panel.corner_m;
  const double a = in_panel_m.dot(panel.side_a_m) / panel.side_a_m.squaredNorm();
  const double b = in_panel_m.dot(panel.side_b_m) / panel.side_b_m.squaredNorm();
  if (a < 0 || a > 1 || b < 0 || b > 1) return std::nullopt;
  return std::abs(along) / step_m.norm();
}

/// Absolute cosine between the line and the vertical where they cross; nothing when they do not.
std::optional<double> crossing(const Slab& slab, const Eigen::Vector3d& from_m,
                               const Eigen::Vector3d& step_m) {
  if (std::abs(step_m.z()) < 1e-12) return std::nullopt;
  const double share = (slab.height_m - from_m.z()) / step_m.z();
  if (share <= 0 || share >= 1) return std::nullopt;
  const Eigen::Vector2d at_m = (from_m + share * step_m).head<2>();
  bool inside = false;  // even-odd rule
  for (std::size_t i = 0, j = slab.outline_m.size() - 1; i < slab.outline_m.size(); j = i++) {
    const Eigen::Vector2d &a = slab.outline_m[i], &b = slab.outline_m[j];
    if ((a.y() > at_m.y()) != (b.y() > at_m.y()) &&
        at_m.x() < (b.x() - a.x()) * (at_m.y() - a.y()) / (b.y() - a.y()) + a.x())
      inside = !inside;
  }
  if (!inside) return std::nullopt;
  return std::abs(step_m.z()) / step_m.norm();
}

void add_crossing(Obstruction& sum, double cosine, double excess_m, double loss_db) {
  const double slant = wall_slant(cosine);
  sum.excess_m += excess_m * slant;
  sum.loss_db += loss_db * slant;
  ++sum.panels;
}

double slab_excess_m(const Material& material, double thickness_m) {
  return anchord::slab_excess_m(material.relative_permittivity, thickness_m);
}

Panel upright(double x0, double y0, double x1, double y1, double height_m, double thickness_m,
              const Material& material) {
  return upright_wall({x0, y0}, {x1, y1}, 0, height_m, thickness_m, material);
}

/// One front: 3.5 m of glass, then a brick pier of 1.5 m, and so on to the corner.
void add_front(World& world, double x0, double y0, double x1, double y1) {
  const double length_m = std::hypot(x1 - x0, y1 - y0);
  const Eigen::Vector2d direction((x1 - x0) / length_m, (y1 - y0) / length_m);
  for (double at_m = 0; at_m < length_m; at_m += 5.0) {
    const double glass_end_m = std::min(at_m + 3.5, length_m), pier_end_m = std::min(at_m + 5.0, length_m);
    const Eigen::Vector2d start = Eigen::Vector2d(x0, y0) + at_m * direction;
    const Eigen::Vector2d middle = Eigen::Vector2d(x0, y0) + glass_end_m * direction;
    const Eigen::Vector2d end = Eigen::Vector2d(x0, y0) + pier_end_m * direction;
    world.panels.push_back(
        upright(start.x(), start.y(), middle.x(), middle.y(), world.height_m, 0.012, k_glass));
    if (pier_end_m > glass_end_m) {
      world.panels.push_back(
          upright(middle.x(), middle.y(), end.x(), end.y(), world.height_m, 0.22, k_brick));
    }
  }
}

}  // namespace

World demonstration_world() {
  World world;
  world.origin = {51.0231, 3.7131, 55.5};
  const double l = world.length_m, w = world.width_m, h = world.height_m;
  add_front(world, 0, 0, l, 0);
  add_front(world, l, 0, l, w);
  add_front(world, l, w, 0, w);
  add_front(world, 0, w, 0, 0);
  world.panels.push_back({{0, 0, h}, {l, 0, 0}, {0, w, 0}, 0.25, k_concrete, {}});
  // Stair core in the middle, partitions at thirds.
  world.panels.push_back(upright(13, 8, 17, 8, h, 0.2, k_concrete));
  world.panels.push_back(upright(17, 8, 17, 12, h, 0.2, k_concrete));
  world.panels.push_back(upright(17, 12, 13, 12, h, 0.2, k_concrete));
  world.panels.push_back(upright(13, 12, 13, 8, h, 0.2, k_concrete));
  world.panels.push_back(upright(10, 0, 10, 8, h, 0.1, k_plasterboard));
  world.panels.push_back(upright(20, 12, 20, 20, h, 0.1, k_plasterboard));
  world.anchors = {{{0x6a21}, {2.1, 1.8, 2.4}},  {{0x6a22}, {27.6, 2.3, 6.1}}, {{0x6a23}, {28.2, 17.9, 2.7}},
                   {{0x6a24}, {3.3, 18.4, 6.6}}, {{0x6a25}, {14.2, 3.1, 3.0}}, {{0x6a26}, {16.8, 16.7, 5.2}}};
  return world;
}

Panel upright_wall(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double bottom_m, double top_m,
                   double thickness_m, const Material& material) {
  return {{from_m.x(), from_m.y(), bottom_m},
          {to_m.x() - from_m.x(), to_m.y() - from_m.y(), 0},
          {0, 0, top_m - bottom_m},
          thickness_m,
          material,
          {}};
}

Panel panel_of(const BuiltWall& wall) {
  Panel panel = upright_wall(wall.from_m, wall.to_m, wall.bottom_m, wall.top_m, wall.thickness_m,
                             material_of(wall.material));
  panel.excess_m = wall_excess_m(wall);
  return panel;
}

Obstruction obstruction_between(const World& world, const Eigen::Vector3d& a_m, const Eigen::Vector3d& b_m) {
  Obstruction sum;
  const Eigen::Vector3d step_m = b_m - a_m;
  for (const Panel& panel : world.panels) {
    if (const auto cosine = crossing(panel, a_m, step_m)) {
      add_crossing(sum, *cosine, panel.excess_m.value_or(slab_excess_m(panel.material, panel.thickness_m)),
                   panel.material.loss_db);
    }
  }
  for (const Slab& slab : world.slabs) {
    if (const auto cosine = crossing(slab, a_m, step_m))
      add_crossing(sum, *cosine, slab_excess_m(slab.material, slab.thickness_m), slab.material.loss_db);
  }
  return sum;
}

}  // namespace anchord::sim
