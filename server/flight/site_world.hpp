#pragma once

#include <map>

#include "core/base/ids.hpp"
#include "core/types/plan.hpp"
#include "core/types/position.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::flight {

/// A world to fly in, and where the aircraft stands in it.
struct Scene {
  sim::World world;
  Eigen::Vector3d home_m{-9, -9, 0};
};

/// The world of a site: its accepted walls, each as delaying as flights are planned by, and 0.25 m of
/// concrete on top of each accepted outline that has walls. Anchors are those that are published; without
/// one, the six of the demonstration building, as far as they lie in the first outline stretched over it (a
/// site without outline: over its walls). The aircraft stands 9 m west and south of all of it.
///
/// origin   ground of the site; the world's metres are about it
/// returns  a world without panels for a site where nothing was accepted
Scene site_scene(const Wgs84& origin, const SiteStructure& structure,
                 const std::map<NetworkId, Wgs84>& published);

}  // namespace anchord::flight
