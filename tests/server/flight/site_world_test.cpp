// The world that is flown at a site: of its accepted walls, as plans of the site see them.
#include "server/flight/site_world.hpp"

#include <gtest/gtest.h>

#include "core/geo/enu.hpp"
#include "core/planning/local_plan.hpp"

namespace anchord::flight::site_world_test {
namespace {

const Wgs84 k_origin{51, 3.7, 20};

LonLat at(double east_m, double north_m) {
  const auto p = EnuFrame(k_origin).wgs84_from_enu(Enu{{east_m, north_m, 0}});
  return {p.lon_deg, p.lat_deg};
}

/// 40 x 20 m from (100, 200), with a front of concrete to the south and a glass partition.
SiteStructure hall() {
  SiteStructure out;
  out.outlines = {{at(100, 200), at(140, 200), at(140, 220), at(100, 220)}};
  out.walls = {{at(100, 200.1), at(140, 200.1), 0, 7, 0.25, WallMaterial::concrete},
               {at(120, 200), at(120, 220), 0, 7, 0.1, WallMaterial::glass}};
  return out;
}

TEST(SiteScene, DelaysRangesAsPlansOfTheSitePredict) {
  const auto scene = site_scene(k_origin, hall(), {});
  Plan plan;
  plan.origin = k_origin;
  plan.structure = std::make_shared<SiteStructure>(hall());
  const auto local = planning::local_plan(plan).value();
  for (const Eigen::Vector3d& from : {Eigen::Vector3d(115, 190, 3), {90, 195, 5}, {150, 230, 2}}) {
    const Eigen::Vector3d to(125, 210, 2);
    const auto simulated = sim::obstruction_between(scene.world, from, to);
    const auto predicted = planning::obstruction_between(*local.walls, from, to);
    EXPECT_EQ(simulated.panels, static_cast<int>(predicted.n)) << from.transpose();
    EXPECT_NEAR(simulated.excess_m, predicted.excess_m, 1e-9) << from.transpose();
  }
  // At right angles through the front: (sqrt(5.2) - 1) x 0.25 m.
  const auto front = sim::obstruction_between(scene.world, {110, 190, 2}, {110, 210, 2});
  EXPECT_NEAR(front.excess_m, 1.2803509 * 0.25, 1e-6);
}

// Concrete of 0.25 m from straight above.
TEST(SiteScene, HasARoofWhereAnOutlineHasWalls) {
  auto structure = hall();
  structure.outlines.push_back({at(0, 0), at(10, 0), at(10, 10), at(0, 10)});
  const auto scene = site_scene(k_origin, structure, {});
  EXPECT_EQ(scene.world.slabs.size(), 1u);
  EXPECT_NEAR(sim::obstruction_between(scene.world, {110, 210, 12}, {110, 210, 2}).excess_m, 1.2803509 * 0.25,
              1e-6);
  EXPECT_EQ(sim::obstruction_between(scene.world, {5, 5, 12}, {5, 5, 2}).panels, 0);
}

TEST(SiteScene, HasThePublishedAnchorsElseSomeInsideItsOutline) {
  const auto published = EnuFrame(k_origin).wgs84_from_enu(Enu{{130, 205, 2.5}});
  const auto with = site_scene(k_origin, hall(), {{NetworkId{0x6a2f}, published}});
  ASSERT_EQ(with.world.anchors.size(), 1u);
  EXPECT_EQ(with.world.anchors[0].id, NetworkId{0x6a2f});
  EXPECT_LT((with.world.anchors[0].enu_m - Eigen::Vector3d(130, 205, 2.5)).norm(), 1e-3);
  const auto without = site_scene(k_origin, hall(), {});
  EXPECT_EQ(without.world.anchors.size(), 6u);
  for (const auto& anchor : without.world.anchors) {
    EXPECT_GT(anchor.enu_m.x(), 100);
    EXPECT_LT(anchor.enu_m.x(), 140);
    EXPECT_GT(anchor.enu_m.y(), 200);
    EXPECT_LT(anchor.enu_m.y(), 220);
    EXPECT_LT(anchor.enu_m.z(), 7) << "under the roof";
  }
}

TEST(SiteScene, PutsTheAircraftBesideTheBuilding) {
  const auto scene = site_scene(k_origin, hall(), {});
  EXPECT_NEAR(scene.home_m.x(), 91, 1e-3);
  EXPECT_NEAR(scene.home_m.y(), 191, 1e-3);
}

TEST(SiteScene, OfASiteWithoutAcceptedPlansIsOpenGround) {
  const auto scene = site_scene(k_origin, {}, {});
  EXPECT_TRUE(scene.world.panels.empty());
  EXPECT_TRUE(scene.world.slabs.empty());
  EXPECT_EQ(scene.world.anchors.size(), 6u);
}

}  // namespace
}  // namespace anchord::flight::site_world_test
