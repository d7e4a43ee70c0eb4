#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/floor_plan/georeference.hpp"
#include "core/floor_plan/image.hpp"

namespace anchord::floor_plan {

inline constexpr int k_tile_px = 256;

/// One square of a pyramid. Columns count from the west, rows from the north, both from 0.
struct Tile {
  int level{}, column{}, row{};
  std::string png;  ///< k_tile_px a side
};

/// A plan turned north up, in squares: level 0 is the whole plan on one tile, each level above has half the
/// metres per pixel of the one below, the last those of the plan. All levels begin at the same north-west
/// corner, so that a pixel of one is exactly four of the next.
struct TilePyramid {
  Eigen::Vector2d north_west_m{0, 0};    ///< ENU
  double m_per_px{};                     ///< of the last level
  std::int64_t width_px{}, height_px{};  ///< that the plan takes of the last level
  int n_levels{};
  std::vector<Tile> tiles;  ///< without those that nothing of the plan lies on
};

/// Columns or rows of a level that cover so many pixels of the last one.
std::int64_t tiles_across(std::int64_t last_level_px, int n_levels, int level);

/// max_bytes  of all PNGs; a plan that would take more has fewer levels, with larger pixels
/// errors     invalid_argument (the plan would cover more than 5 km)
/// accuracy   a mark is within a pixel of each level of where `transform` has it (tiles_test.cpp)
/// memory     beside the image and the PNGs less than 16 MB: one branch of the levels at a time
/// threads    pure
Result<TilePyramid> make_tiles(const Image& rgb, const PlanTransform& transform,
                               std::size_t max_bytes = std::size_t{128} << 20);

}  // namespace anchord::floor_plan
