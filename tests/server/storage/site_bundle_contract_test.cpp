// Buildings, floors and pictures of plans go with the bundle of their site, over every backend.
#include "core/ports/bundle_store.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/site_store.hpp"
#include "tests/server/storage/backends.hpp"
#include "tests/server/storage/bundle_rows.hpp"

namespace anchord::site_bundle_contract_test {
namespace {

using testing::Contains;
using testing::Field;
using testing::HasSubstr;

class SiteBundleContract : public StoreContract {
 protected:
  struct Place {
    Site site;
    Building building;
    Floor floor;
  };
  /// A floor with its plan, of more than one part, and two tiles.
  Place drawn() {
    Place p;
    p.site.id = SiteId{make_uuid_v7(k_noon)};
    p.site.name = "Hall";
    EXPECT_TRUE(db_->stores().sites.insert(p.site));
    p.building.id = BuildingId{make_uuid_v7(k_noon)};
    p.building.site = p.site.id;
    p.building.name = "B1";
    p.building.height_m = 9.5;
    p.building.created = k_noon;
    PlaceStore& places = db_->stores().places;
    EXPECT_TRUE(places.insert(p.building));
    p.floor.id = FloorId{make_uuid_v7(k_noon)};
    p.floor.building = p.building.id;
    p.floor.name = "Ground";
    p.floor.created = k_noon;
    EXPECT_TRUE(places.insert(p.floor));
    p.floor.plan =
        StoredImage{ImageId{make_uuid_v7(k_noon)}, ImageKind::plan, "image/png", 400, 300, 0, "sum"};
    p.floor.plan->bytes = static_cast<std::int64_t>(plan_bytes().size());
    EXPECT_TRUE(places.keep(p.floor.id, *p.floor.plan, plan_bytes()));
    const StoredImage unnamed{ImageId{make_uuid_v7(k_noon)}, ImageKind::preview, "image/png", 4, 3, 0, "sum"};
    EXPECT_TRUE(places.keep(p.floor.id, unnamed, "being written"));
    PlanTiles tiles;
    tiles.id = PlanTilesId{make_uuid_v7(k_noon)};
    tiles.n_levels = 1;
    tiles.m_per_px = 0.1 / 3;
    tiles.sha256_hex = "sum";
    const std::vector<PlanTile> pictures{{0, 0, 0, std::string_view("\0tile", 5)}, {0, 1, 0, "other"}};
    EXPECT_TRUE(places.keep(p.floor.id, tiles, pictures));
    p.floor.tiles = tiles;
    EXPECT_TRUE(places.update(p.floor, 1));
    p.floor = places.floor(p.floor.id).value();
    return p;
  }
  static std::string plan_bytes() {
    std::string bytes((std::size_t{1} << 20) + 77, '\0');
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 31 % 251);
    return bytes;
  }
  static BundleRows written(Database& db, const SiteId& site) {
    BundleRows rows;
    const auto done = db.stores().bundles.write_site(site, rows);
    EXPECT_TRUE(done) << done.error().message;
    return rows;
  }
};

TEST_P(SiteBundleContract, BringsBuildingsFloorsAndPictures) {
  const auto place = drawn();
  BundleRows rows = written(*db_, place.site.id);
  EXPECT_EQ(rows.tables.at("plan_image").size(), 1u) << "not the one that no floor names";
  EXPECT_EQ(rows.tables.at("plan_image_part").size(), 2u);
  EXPECT_EQ(rows.tables.at("plan_tile").size(), 2u);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  const auto taken = other->stores().bundles.take_site(place.site.id, rows);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_TRUE(taken.value().left_out.empty());
  PlaceStore& there = other->stores().places;
  EXPECT_EQ(there.building(place.building.id).value().height_m, 9.5);
  const auto floor = there.floor(place.floor.id).value();
  ASSERT_TRUE(floor.plan);
  EXPECT_FALSE(floor.preview);
  EXPECT_EQ(there.bytes(floor.plan->id).value(), plan_bytes());
  ASSERT_TRUE(floor.tiles);
  EXPECT_EQ(floor.tiles->m_per_px, 0.1 / 3);
  EXPECT_EQ(there.tile(floor.tiles->id, 0, 0, 0).value(), std::string("\0tile", 5));
  EXPECT_EQ(written(*other, place.site.id).tables, rows.tables);
  EXPECT_FALSE(other->stores().bundles.take_site(place.site.id, rows).value().added());
  EXPECT_FALSE(db_->stores().bundles.take_site(place.site.id, rows).value().added());
}

TEST_P(SiteBundleContract, IsTakenWithoutTablesThatCameLater) {
  const auto place = drawn();
  BundleRows rows = written(*db_, place.site.id);
  for (const auto& table : db_->stores().bundles.site_tables())
    if (table.later) rows.tables.erase(table.name);
  EXPECT_EQ(rows.tables.size(), 5u) << "those of the first version";
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  EXPECT_TRUE(other->stores().bundles.take_site(place.site.id, rows));
  EXPECT_EQ(other->stores().places.buildings(10, {}, place.site.id).value().size(), 0u);
}

TEST_P(SiteBundleContract, LeavesAFloorThatWasEditedHereWithItsOwnPictures) {
  const auto place = drawn();
  BundleRows rows = written(*db_, place.site.id);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  ASSERT_TRUE(other->stores().bundles.take_site(place.site.id, rows));
  PlaceStore& there = other->stores().places;
  auto floor = there.floor(place.floor.id).value();
  floor.name = "as it is here";
  const StoredImage own{ImageId{make_uuid_v7(k_noon)}, ImageKind::plan, "image/png", 4, 3, 0, "own"};
  ASSERT_TRUE(there.keep(floor.id, own, "own picture"));
  floor.plan = own;
  floor.tiles.reset();
  ASSERT_TRUE(there.update(floor, floor.version));
  const auto again = other->stores().bundles.take_site(place.site.id, rows);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_FALSE(again.value().added());
  using LeftOut = BundleOutcome::LeftOut;
  EXPECT_THAT(again.value().left_out, Contains(Field(&LeftOut::what, HasSubstr("building_floor"))));
  EXPECT_THAT(again.value().left_out, Contains(Field(&LeftOut::why, HasSubstr("its own pictures"))));
  const auto stays = there.floor(place.floor.id).value();
  EXPECT_EQ(stays.name, "as it is here");
  EXPECT_EQ(there.bytes(stays.plan->id).value(), "own picture");
  EXPECT_FALSE(stays.tiles);
}

/// Cells of ids stand where the columns of the table have them.
BundleCell& cell_of(BundleStore& store, BundleRows& rows, const std::string& table,
                    const std::string& column) {
  const auto& all = store.site_tables();
  const auto& columns = std::ranges::find(all, table, &BundleTable::name)->columns;
  const auto at = std::ranges::find(columns, column, &BundleColumn::name) - columns.begin();
  return rows.tables.at(table).at(0).at(static_cast<std::size_t>(at));
}
BundleCell cell(const Uuid& id) {
  return std::string(reinterpret_cast<const char*>(id.bytes.data()), id.bytes.size());
}

TEST_P(SiteBundleContract, RefusesAsAWholeWhatIsOfAnotherSite) {
  const auto place = drawn();
  const BundleRows rows = written(*db_, place.site.id);
  ScratchDir folder;
  const auto other = open_sqlite(folder.path() / "data");
  auto& stores = other->stores();
  Site theirs;
  theirs.id = SiteId{make_uuid_v7(k_noon)};
  theirs.name = "of somebody else";
  ASSERT_TRUE(stores.sites.insert(theirs));
  Building house;
  house.id = BuildingId{make_uuid_v7(k_noon)};
  house.site = theirs.id;
  house.name = "theirs";
  house.created = k_noon;
  ASSERT_TRUE(stores.places.insert(house));
  BundleRows site = rows, building = rows, floor = rows, taken_over = rows;
  cell_of(stores.bundles, site, "site", "id") = cell(SiteId{make_uuid_v7(k_noon)}.uuid);
  cell_of(stores.bundles, building, "building", "site_id") = cell(theirs.id.uuid);
  cell_of(stores.bundles, floor, "building_floor", "building_id") = cell(house.id.uuid);
  // Says that the building is of the bundle's site.
  cell_of(stores.bundles, taken_over, "building", "id") = cell(house.id.uuid);
  cell_of(stores.bundles, taken_over, "building_floor", "building_id") = cell(house.id.uuid);
  for (BundleRows* forged : {&site, &building, &floor, &taken_over}) {
    const auto refused = stores.bundles.take_site(place.site.id, *forged);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::invalid_argument);
    EXPECT_THAT(refused.error().message, HasSubstr("is of another one"));
    EXPECT_FALSE(stores.sites.site(place.site.id)) << "nothing of it was taken";
    EXPECT_EQ(stores.places.buildings(10, {}, theirs.id).value().size(), 1u);
    EXPECT_FALSE(stores.places.floor(place.floor.id));
  }
  BundleRows whole = rows;
  EXPECT_TRUE(stores.bundles.take_site(place.site.id, whole));
}

INSTANTIATE_TEST_SUITE_P(Backends, SiteBundleContract, backends(), backend_name);

}  // namespace
}  // namespace anchord::site_bundle_contract_test
