#include "server/flight/site_world.hpp"

#include <algorithm>
#include <optional>

#include "core/geo/enu.hpp"
#include "core/planning/bounds.hpp"

namespace anchord::flight {
namespace {

constexpr double k_apart_m = 9;
constexpr double k_roof_m = 0.25;  // as of the demonstration building

/// Round all that is given to it.
struct Box {
  Eigen::Vector2d low{0, 0}, high{0, 0};
  bool empty{true};
  void add(const Eigen::Vector2d& p) {
    low = empty ? p : low.cwiseMin(p).eval();
    high = empty ? p : high.cwiseMax(p).eval();
    empty = false;
  }
};

/// Height of the walls in an outline; none: nothing holds a roof there.
std::optional<double> top_of(const planning::Polygon& outline, const std::vector<BuiltWall>& walls) {
  std::optional<double> out;
  for (const auto& wall : walls) {
    if (planning::contains(outline, (wall.from_m + wall.to_m) / 2))
      out = std::max(out.value_or(wall.top_m), wall.top_m);
  }
  return out;
}

/// Those of the demonstration, at the same shares of length, width and height.
std::vector<sim::WorldAnchor> stretched_anchors(const planning::Polygon& outline, const Box& box,
                                                double height_m) {
  const auto demonstration = sim::demonstration_world();
  std::vector<sim::WorldAnchor> out;
  for (auto anchor : demonstration.anchors) {
    const Eigen::Vector2d share(anchor.enu_m.x() / demonstration.length_m,
                                anchor.enu_m.y() / demonstration.width_m);
    anchor.enu_m.head<2>() = box.low + share.cwiseProduct(box.high - box.low);
    anchor.enu_m.z() *= height_m / demonstration.height_m;
    if (outline.empty() || planning::contains(outline, anchor.enu_m.head<2>())) out.push_back(anchor);
  }
  return out;
}

}  // namespace

Scene site_scene(const Wgs84& origin, const SiteStructure& structure,
                 const std::map<NetworkId, Wgs84>& published) {
  const EnuFrame frame(origin);
  const auto metres = [&](const LonLat& p) -> Eigen::Vector2d {
    return frame.enu_from_wgs84({p.lat_deg, p.lon_deg, origin.height_m}).m.head<2>();
  };
  Scene out;
  out.world.origin = origin;
  Box all, first;
  std::vector<BuiltWall> walls;
  double height_m = 0;
  for (const auto& w : structure.walls) {
    walls.push_back({metres(w.from), metres(w.to), w.bottom_m, w.top_m, w.thickness_m, w.material});
    out.world.panels.push_back(sim::panel_of(walls.back()));
    height_m = std::max(height_m, w.top_m);
    all.add(walls.back().from_m);
    all.add(walls.back().to_m);
  }
  planning::Polygon first_outline;
  for (const auto& corners : structure.outlines) {
    planning::Polygon outline;
    for (const auto& corner : corners) {
      outline.push_back(metres(corner));
      all.add(outline.back());
    }
    if (const auto top_m = top_of(outline, walls))
      out.world.slabs.push_back({outline, *top_m, k_roof_m, sim::k_concrete});
    if (first_outline.empty()) first_outline = outline;
  }
  for (const auto& corner : first_outline) first.add(corner);
  if (height_m > 0) out.world.height_m = height_m;
  if (!all.empty) {
    out.world.length_m = (all.high - all.low).x();
    out.world.width_m = (all.high - all.low).y();
    out.home_m.head<2>() = all.low - Eigen::Vector2d::Constant(k_apart_m);
  }
  for (const auto& [id, at] : published) out.world.anchors.push_back({id, frame.enu_from_wgs84(at).m, {}});
  if (out.world.anchors.empty()) {
    const Box& box = first.empty ? all : first;
    out.world.anchors = box.empty ? sim::demonstration_world().anchors
                                  : stretched_anchors(first_outline, box, out.world.height_m);
  }
  return out;
}

}  // namespace anchord::flight
