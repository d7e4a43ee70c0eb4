// Changes of datum against the published example of EPSG Guidance Note 7-2 (methods 1033 and 1032: WGS 72 to
// WGS 84).
#include "core/geo/datum.hpp"

#include <gtest/gtest.h>

#include "core/geo/enu.hpp"

namespace anchord::datum_test {
namespace {

TEST(DatumChange, MatchesThePublishedExample) {
  const DatumChange change{{0, 0, 4.5}, {0, 0, 0.554}, 0.219};
  const Eigen::Vector3d wgs72_m(3657660.66, 255768.55, 5201382.11),
      wgs84_m(3657660.78, 255778.43, 5201387.75);
  EXPECT_LT((change.ecef_m(wgs72_m) - wgs84_m).cwiseAbs().maxCoeff(), 0.006);  // printed to the centimetre
}

TEST(DatumChange, MovesAPlaceEastNorthAndUp) {
  const Wgs84 place{51.02, 3.71, 55};
  const Eigen::Vector3d by_m(0.4, -0.1, 0.03);
  const Wgs84 moved = datum_change_at(place, by_m).wgs84(place);
  EXPECT_LT((EnuFrame(place).enu_from_wgs84(moved).m - by_m).norm(), 1e-8);
}

TEST(DatumChange, TakesOnePlaceToAnother) {
  const Wgs84 before{51.02, 3.71, 55}, after{51.0201, 3.7099, 54};
  const Wgs84 moved = datum_change_between(before, after).wgs84(before);
  EXPECT_LT(EnuFrame(after).enu_from_wgs84(moved).m.norm(), 1e-8);
}

}  // namespace
}  // namespace anchord::datum_test
