#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/base/enum_table.hpp"

namespace anchord {

/// What a wall is made of.
enum class WallMaterial : std::uint8_t { unknown, brick, concrete, glass, plasterboard, metal };
inline constexpr auto k_wall_material_words =
    enum_table<WallMaterial>({{"unknown", WallMaterial::unknown},
                              {"brick", WallMaterial::brick},
                              {"concrete", WallMaterial::concrete},
                              {"glass", WallMaterial::glass},
                              {"plasterboard", WallMaterial::plasterboard},
                              {"metal", WallMaterial::metal}});

/// What it does to a ranging signal of 4 to 6.5 GHz.
struct MaterialProperties {
  double relative_permittivity{1};
  double loss_db{};         ///< of one wall at right angles
  double most_solid_m{10};  ///< of the thickness of a wall at most so much is material, the rest is air
};

/// Permittivities: ITU-R P.2040-3 table 3 (5.24, 3.91, 2.73, 6.31), to the digit that walls of one material
/// differ by. Losses: of usual thickness, in the middle of published UWB wall tests (Safaai-Jazi, Riad,
/// Muqaibel and Bayram, Through-the-Wall Propagation and Material Characterization, Virginia Tech 2002; brick
/// and concrete of buildings lose more than dry samples). Glass is two panes of 6 mm, plasterboard two boards
/// of 12.5 mm (EN 520) on studs, however thick the wall is drawn. Metal lets nothing through: 60 dB are more
/// than a link has at one metre. Unknown is taken as brick, which is between the others.
constexpr MaterialProperties properties_of(WallMaterial material) {
  switch (material) {
    case WallMaterial::concrete:
      return {5.2, 14.0};
    case WallMaterial::glass:
      return {6.3, 2.0, 0.012};
    case WallMaterial::plasterboard:
      return {2.7, 1.5, 0.025};
    case WallMaterial::metal:
      return {1.0, 60.0};
    case WallMaterial::unknown:
    case WallMaterial::brick:
      break;
  }
  return {3.9, 7.0};
}

/// Extra optical path of a dielectric slab at right angles: (sqrt(permittivity) - 1) thickness.
inline double slab_excess_m(double relative_permittivity, double thickness_m) {
  return (std::sqrt(relative_permittivity) - 1.0) * thickness_m;
}

/// Delay and loss at an angle are those at right angles times this: 1 / cos(incidence), not above 5, for a
/// grazing ray leaves through the edge of the wall.
inline double wall_slant(double cosine) { return 1.0 / std::max(cosine, 0.2); }

/// An upright wall by its middle line; metres of the frame it is used in.
struct BuiltWall {
  Eigen::Vector2d from_m{0, 0}, to_m{0, 0};
  double bottom_m{}, top_m{};
  double thickness_m{0.1};
  WallMaterial material{WallMaterial::unknown};
};

/// Of the wall at right angles.
inline double wall_excess_m(const BuiltWall& wall) {
  const auto made = properties_of(wall.material);
  return slab_excess_m(made.relative_permittivity, std::min(wall.thickness_m, made.most_solid_m));
}

}  // namespace anchord
