// Buildings, floors and pictures of plans, over every backend.
#include "core/ports/place_store.hpp"
#include "core/ports/site_store.hpp"
#include "tests/server/storage/backends.hpp"

namespace anchord::place_contract_test {
namespace {

class PlaceStoreContract : public StoreContract {
 protected:
  PlaceStore& places() { return db_->stores().places; }
  Site stored_site() {
    Site site;
    site.id = SiteId{make_uuid_v7(k_noon)};
    EXPECT_TRUE(db_->stores().sites.insert(site));
    return site;
  }
  Building stored_building() {
    Building b;
    b.id = BuildingId{make_uuid_v7(k_noon)};
    b.site = stored_site().id;
    b.name = "B1";
    b.height_m = 9.5;
    b.created = k_noon;
    EXPECT_TRUE(places().insert(b));
    return b;
  }
  Floor stored_floor(const Building& building) {
    Floor f;
    f.id = FloorId{make_uuid_v7(k_noon)};
    f.building = building.id;
    f.name = "Mezzanine";
    f.level = 0.5;
    f.base_height_m = -0.25;
    f.created = k_noon;
    EXPECT_TRUE(places().insert(f));
    return f;
  }
  StoredImage picture(ImageKind kind) {
    return {ImageId{make_uuid_v7(k_noon)}, kind, "image/png", 400, 300, 0, "sum"};
  }
};

TEST_P(PlaceStoreContract, GivesBackEveryField) {
  const auto building = stored_building();
  auto floor = stored_floor(building);
  floor.georeference = {R"({"a":1})"};
  floor.proposal = {"{}"};
  floor.structure = {R"({"walls":[]})"};
  ASSERT_TRUE(places().update(floor, 1));
  const auto b = places().building(building.id).value();
  EXPECT_EQ(b.site, building.site);
  EXPECT_EQ(b.name, "B1");
  EXPECT_EQ(b.height_m, 9.5);
  EXPECT_EQ(b.created, k_noon);
  const auto f = places().floor(floor.id).value();
  EXPECT_EQ(f.building, building.id);
  EXPECT_EQ(f.name, "Mezzanine");
  EXPECT_EQ(f.level, 0.5);
  EXPECT_EQ(f.base_height_m, -0.25);
  EXPECT_EQ(f.georeference, floor.georeference);
  EXPECT_EQ(f.proposal, floor.proposal);
  EXPECT_EQ(f.structure, floor.structure);
  EXPECT_EQ(f.version, 2u);
  EXPECT_FALSE(f.plan);
  EXPECT_EQ(places().buildings(10, {}, building.site).value().size(), 1u);
  EXPECT_EQ(places().buildings(10, {}, SiteId{make_uuid_v7(k_noon)}).value().size(), 0u);
  EXPECT_EQ(places().floors(10, {}, building.id).value().size(), 1u);
  EXPECT_EQ(places().floors(10, floor.id, {}).value().size(), 0u);
}

TEST_P(PlaceStoreContract, RefusesWhatStandsOnNothingAndWhatOthersStandOn) {
  Building b;
  b.id = BuildingId{make_uuid_v7(k_noon)};
  b.site = SiteId{make_uuid_v7(k_noon)};
  EXPECT_EQ(places().insert(b).error().code, Errc::not_found);
  Floor f;
  f.id = FloorId{make_uuid_v7(k_noon)};
  f.building = b.id;
  EXPECT_EQ(places().insert(f).error().code, Errc::not_found);
  const auto building = stored_building();
  const auto floor = stored_floor(building);
  EXPECT_EQ(places().remove(building.id, 1).error().code, Errc::conflict);
  EXPECT_EQ(db_->stores().sites.remove(building.site, 1).error().code, Errc::conflict);
  EXPECT_EQ(places().remove(floor.id, 7).error().code, Errc::conflict);
  ASSERT_TRUE(places().remove(floor.id, 1));
  ASSERT_TRUE(places().remove(building.id, 1));
  EXPECT_TRUE(db_->stores().sites.remove(building.site, 1));
  EXPECT_EQ(places().update(floor, 1).error().code, Errc::not_found);
}

TEST_P(PlaceStoreContract, ChangesOnlyTheVersionThatWasRead) {
  auto building = stored_building();
  building.name = "other";
  ASSERT_TRUE(places().update(building, 1));
  EXPECT_EQ(places().update(building, 1).error().code, Errc::conflict);
  auto floor = stored_floor(building);
  ASSERT_TRUE(places().update(floor, 1));
  EXPECT_EQ(places().update(floor, 1).error().code, Errc::conflict);
}

TEST_P(PlaceStoreContract, KeepsPicturesByteForByteAndForgetsThoseNobodyNames) {
  auto floor = stored_floor(stored_building());
  std::string bytes;
  for (std::uint32_t i = 0; i < 2'500'000; ++i) bytes += static_cast<char>(i * 2654435761u >> 24);
  floor.plan = picture(ImageKind::plan);
  floor.preview = picture(ImageKind::preview);
  ASSERT_TRUE(places().keep(floor.id, *floor.plan, bytes));
  ASSERT_TRUE(places().keep(floor.id, *floor.preview, "small"));
  EXPECT_FALSE(places().floor(floor.id).value().plan) << "nobody named it yet";
  ASSERT_TRUE(places().update(floor, 1));
  const auto found = places().floor(floor.id).value();
  ASSERT_TRUE(found.plan && found.preview);
  EXPECT_FALSE(found.backdrop);
  EXPECT_EQ(found.plan->id, floor.plan->id);
  EXPECT_EQ(found.plan->bytes, 2'500'000);
  EXPECT_EQ(found.plan->width_px, 400);
  EXPECT_EQ(found.plan->sha256_hex, "sum");
  EXPECT_TRUE(places().bytes(floor.plan->id).value() == bytes);
  EXPECT_EQ(places().bytes(floor.preview->id).value(), "small");

  const auto former = floor.plan->id;
  floor.plan = picture(ImageKind::plan);
  ASSERT_TRUE(places().keep(floor.id, *floor.plan, "new"));
  ASSERT_TRUE(places().update(floor, 2));
  EXPECT_EQ(places().bytes(former).error().code, Errc::not_found);
  EXPECT_EQ(places().bytes(floor.plan->id).value(), "new");
  ASSERT_TRUE(places().remove(floor.id, 3));
  EXPECT_EQ(places().bytes(floor.plan->id).error().code, Errc::not_found);
}

/// A pyramid of `n` rows of one tile each on its only level, and a picture of its own for each.
struct Pyramid {
  PlanTiles tiles{PlanTilesId{make_uuid_v7(k_noon)}, 2, 0.025, 700, 900, -3.5, 81.25, 12, "sum"};
  std::vector<std::string> pngs;
  std::vector<PlanTile> pictures() const {
    std::vector<PlanTile> out;
    for (const auto& png : pngs) out.push_back({1, 0, static_cast<int>(out.size()), png});
    return out;
  }
  explicit Pyramid(int n) {
    for (int i = 0; i < n; ++i) pngs.push_back(std::string(1, '\0') + "png " + std::to_string(i));
  }
};

TEST_P(PlaceStoreContract, KeepsTheTilesOfAPlanAndGivesEachBackByItsPlace) {
  auto floor = stored_floor(stored_building());
  const Pyramid made(700);  // more than one transaction writes
  ASSERT_TRUE(places().keep(floor.id, made.tiles, made.pictures()));
  EXPECT_FALSE(places().floor(floor.id).value().tiles) << "nobody named them yet";
  floor.tiles = made.tiles;
  ASSERT_TRUE(places().update(floor, 1));
  const auto found = places().floors(10, {}, {}).value().at(0).tiles;
  ASSERT_TRUE(found);
  EXPECT_EQ(found->id, made.tiles.id);
  EXPECT_EQ(found->n_levels, 2);
  EXPECT_EQ(found->m_per_px, 0.025);
  EXPECT_EQ(found->width_px, 700);
  EXPECT_EQ(found->height_px, 900);
  EXPECT_EQ(found->west_m, -3.5);
  EXPECT_EQ(found->north_m, 81.25);
  EXPECT_EQ(found->bytes, 12);
  EXPECT_EQ(found->sha256_hex, "sum");
  for (const int row : {0, 255, 256, 699})
    EXPECT_EQ(places().tile(made.tiles.id, 1, 0, row).value(), made.pngs[static_cast<std::size_t>(row)]);
  EXPECT_FALSE(places().tile(made.tiles.id, 1, 0, 700).value());
  EXPECT_FALSE(places().tile(made.tiles.id, 0, 0, 0).value());
}

TEST_P(PlaceStoreContract, ForgetsTilesWithTheirPlanAndWithTheirFloor) {
  auto floor = stored_floor(stored_building());
  auto other = stored_floor(stored_building());
  const Pyramid first(300), second(2), others(1);
  for (auto* one : {&floor, &other}) {
    const auto& made = one == &floor ? first : others;
    ASSERT_TRUE(places().keep(one->id, made.tiles, made.pictures()));
    one->tiles = made.tiles;
    ASSERT_TRUE(places().update(*one, 1));
  }
  ASSERT_TRUE(places().keep(floor.id, second.tiles, second.pictures()));
  floor.tiles = second.tiles;
  ASSERT_TRUE(places().update(floor, 2));
  for (const int row : {0, 299}) EXPECT_FALSE(places().tile(first.tiles.id, 1, 0, row).value());
  EXPECT_TRUE(places().tile(second.tiles.id, 1, 0, 1).value());
  // A floor that was changed meanwhile keeps no more tiles of those that it does not name.
  EXPECT_EQ(places().keep(floor.id, first.tiles, first.pictures()).has_value(), true);
  ASSERT_TRUE(places().update(floor, 3));
  floor.tiles = first.tiles;
  EXPECT_EQ(places().update(floor, 4).error().code, Errc::not_found);
  ASSERT_TRUE(places().remove(floor.id, 4));
  EXPECT_FALSE(places().tile(second.tiles.id, 1, 0, 1).value());
  EXPECT_TRUE(places().tile(others.tiles.id, 1, 0, 0).value()) << "another floor's stay";
}

INSTANTIATE_TEST_SUITE_P(Backends, PlaceStoreContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::place_contract_test
