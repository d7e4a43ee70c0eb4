#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/types/position.hpp"
#include "core/types/wall.hpp"

namespace anchord::sim {

/// What a panel is made of. The excess delay of a crossing is (sqrt(permittivity) - 1) * thickness /
/// cos(incidence), the extra optical path of a dielectric slab; its loss is `loss_db` at right angles,
/// divided by the same cosine. Values and their sources: core/types/wall.hpp, by which flights are planned
/// too.
struct Material {
  std::string_view name;
  double relative_permittivity{};
  double loss_db{};
};
constexpr Material material_of(WallMaterial material) {
  const auto made = properties_of(material);
  return {k_wall_material_words.word(material), made.relative_permittivity, made.loss_db};
}
inline constexpr Material k_glass = material_of(WallMaterial::glass);
inline constexpr Material k_brick = material_of(WallMaterial::brick);
inline constexpr Material k_concrete = material_of(WallMaterial::concrete);
inline constexpr Material k_plasterboard = material_of(WallMaterial::plasterboard);
inline constexpr Material k_metal = material_of(WallMaterial::metal);

/// A flat rectangular piece of wall, window or ceiling; ENU metres.
struct Panel {
  Eigen::Vector3d corner_m{0, 0, 0};
  Eigen::Vector3d side_a_m{0, 0, 0}, side_b_m{0, 0, 0};  ///< at right angles to each other
  double thickness_m{};
  Material material{};
  std::optional<double> excess_m{};  ///< extra path at right angles; absent: from thickness and material
};

/// A floor or roof: a polygon (x, y) at one height, any number of corners, either way round.
struct Slab {
  std::vector<Eigen::Vector2d> outline_m;
  double height_m{};
  double thickness_m{};
  Material material{};
};

struct WorldAnchor {
  NetworkId id{};
  Eigen::Vector3d enu_m{0, 0, 0};
  std::optional<double> clock_drift_ppm{};  ///< of its crystal; absent: as the first tag's
};

/// What stands on the site, in ENU metres of `origin`.
struct World {
  Wgs84 origin{};
  double length_m{30}, width_m{20}, height_m{8};  ///< of the building: x 0..length, y 0..width, z 0..height
  std::vector<Panel> panels;
  std::vector<Slab> slabs;
  std::vector<WorldAnchor> anchors;
};

/// An upright wall between two points seen from above.
Panel upright_wall(const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double bottom_m, double top_m,
                   double thickness_m, const Material& material);

/// The panel of a wall that was accepted from a floor plan.
Panel panel_of(const BuiltWall& wall);

/// The demonstration building: 30 x 20 x 8 m with glass fronts between brick piers, a concrete stair core,
/// plasterboard partitions and a concrete roof; six anchors inside, at 2.4 to 6.6 m.
World demonstration_world();

/// What lies on the straight line between two points.
struct Obstruction {
  double excess_m{};  ///< extra path, so that ranges come out long by this much
  double loss_db{};
  int panels{};
};
Obstruction obstruction_between(const World& world, const Eigen::Vector3d& a_m, const Eigen::Vector3d& b_m);

}  // namespace anchord::sim
