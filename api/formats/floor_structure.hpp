#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/types/place.hpp"
#include "core/types/plan.hpp"

namespace anchord {

/// Most walls of a site that are planned with; of more the longest are kept, for short pieces change least.
inline constexpr std::size_t k_most_site_walls = 20'000;

/// Where the floor of a storey is, and how high its walls are; above the ground.
struct StoreyHeights {
  double bottom_m{}, top_m{};
};
/// As stated by base_height_m of a floor, else 3 m a level; up to the next floor above, else to the roof of
/// the building, else 3 m.
StoreyHeights storey_heights(const Floor& floor, std::span<const Floor> of_building,
                             const Building& building);

/// Adds what was accepted of a floor, {outline, walls} as api/places keeps and serves it. What is no wall in
/// it is left out; an outline that is there already is not added again.
void add_floor_structure(std::string_view structure_json, const StoreyHeights& heights, SiteStructure& out);

/// The longest walls alone, at most `most` of them.
void keep_longest(SiteStructure& structure, std::size_t most = k_most_site_walls);

}  // namespace anchord
