#include "api/planning/site_structures.hpp"

#include <vector>

#include "api/formats/floor_structure.hpp"
#include "api/kit/current_sites.hpp"
#include "core/ports/place_store.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_page = 20;  // the documents of a floor may be some megabytes

/// Every one of a listing, page by page.
template <class Page, class Take>
Result<void> for_each(const Page& page, const Take& take) {
  using Id = decltype(page(k_page, std::nullopt).value().front().id);
  std::optional<Id> after;
  while (true) {
    BOOST_OUTCOME_TRY(auto rows, page(k_page, after));
    for (auto& row : rows) take(row);
    if (rows.size() < k_page) return boost::outcome_v2::success();
    after = rows.back().id;
  }
}

}  // namespace

void SiteStructures::changed() {
  auto kept = kept_.lock();
  ++kept->change;
  kept->of_site.clear();
}

Result<void> SiteStructures::join(Plan& plan) {
  plan.structure.reset();
  if (!plan.site || !current_sites().holds(plan.site)) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(plan.structure, of(*plan.site));
  return boost::outcome_v2::success();
}

Result<SiteStructures::Shared> SiteStructures::of(const SiteId& site) {
  std::uint64_t change = 0;
  {
    const auto kept = kept_.lock();
    const auto known = kept->of_site.find(site);
    if (known != kept->of_site.end()) return known->second;
    change = kept->change;
  }
  BOOST_OUTCOME_TRY(auto structure, read(site));
  structure.version = change;
  Shared shared = std::make_shared<const SiteStructure>(std::move(structure));
  auto kept = kept_.lock();
  // What was changed while it was read may not be in it: the next reader reads anew.
  if (kept->change == change) kept->of_site.insert_or_assign(site, shared);
  return shared;
}

Result<SiteStructure> SiteStructures::read(const SiteId& site) {
  std::vector<Building> buildings;
  BOOST_OUTCOME_TRYV(
      for_each([&](std::size_t limit,
                   const std::optional<BuildingId>& after) { return places_.buildings(limit, after, site); },
               [&](Building& building) { buildings.push_back(std::move(building)); }));
  SiteStructure out;
  for (const auto& building : buildings) {
    const auto floors = [&](std::size_t limit, const std::optional<FloorId>& after) {
      return places_.floors(limit, after, building.id);
    };
    // Heights of all first: walls end at the floor above.
    std::vector<Floor> heights;
    BOOST_OUTCOME_TRYV(for_each(floors, [&](const Floor& floor) {
      Floor& kept = heights.emplace_back();
      kept.level = floor.level;
      kept.base_height_m = floor.base_height_m;
    }));
    BOOST_OUTCOME_TRYV(for_each(floors, [&](const Floor& floor) {
      add_floor_structure(floor.structure.text, storey_heights(floor, heights, building), out);
      if (out.walls.size() > 2 * k_most_site_walls) keep_longest(out);
    }));
  }
  keep_longest(out);
  return out;
}

}  // namespace anchord::api
