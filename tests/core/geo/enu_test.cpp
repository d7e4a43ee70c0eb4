#include "core/geo/enu.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace anchord::enu_test {
namespace {

// Semi-axes of WGS84 (NIMA TR8350.2, table 3.1).
constexpr double k_a_m = 6378137.0;
constexpr double k_b_m = 6356752.314245179;

TEST(EnuFrame, PutsTheAxesOfTheEllipsoidWhereTheyAre) {
  EXPECT_LT((ecef_from_wgs84({0, 0, 0}) - Eigen::Vector3d(k_a_m, 0, 0)).norm(), 1e-6);
  EXPECT_LT((ecef_from_wgs84({0, 90, 100}) - Eigen::Vector3d(0, k_a_m + 100, 0)).norm(), 1e-6);
  EXPECT_LT((ecef_from_wgs84({90, 0, 50}) - Eigen::Vector3d(0, 0, k_b_m + 50)).norm(), 1e-6);
}

TEST(EnuFrame, AgreesWithThePublishedCartConvertExample) {
  // man CartConvert(1): echo 33.3 44.4 6000 | CartConvert  ->  3816209.60 3737108.55 3485109.57
  const Eigen::Vector3d ecef = ecef_from_wgs84({33.3, 44.4, 6000});
  EXPECT_NEAR(ecef.x(), 3816209.60, 0.005);
  EXPECT_NEAR(ecef.y(), 3737108.55, 0.005);
  EXPECT_NEAR(ecef.z(), 3485109.57, 0.005);
}

TEST(EnuFrame, AgreesWithThePublishedLocalCartesianExample) {
  // man CartConvert(1): echo 33.3 44.4 6000 | CartConvert -l 33 44 20  ->  37288.97 33374.29 5783.65
  const Enu at = EnuFrame({33, 44, 20}).enu_from_wgs84({33.3, 44.4, 6000});
  EXPECT_NEAR(at.m.x(), 37288.97, 0.005);
  EXPECT_NEAR(at.m.y(), 33374.29, 0.005);
  EXPECT_NEAR(at.m.z(), 5783.65, 0.005);
}

TEST(EnuFrame, GoesThereAndBackWithinAMicrometre) {
  const EnuFrame frame({50.87, 4.70, 80});
  for (const double e : {-15'000.0, -3.0, 0.0, 250.0}) {
    const Enu there{{e, 2 * e + 7, 12}};
    EXPECT_LT((frame.enu_from_wgs84(frame.wgs84_from_enu(there)).m - there.m).norm(), 1e-6);
  }
}

TEST(EnuFrame, TurnsACovarianceWithTheMeridians) {
  // 90 degrees of longitude further along the equator, east there is the direction from this place's up
  // inwards.
  const EnuFrame here({0, 0, 0});
  const EnuFrame there({0, 90, 0});
  const Eigen::Matrix3d up_only = Eigen::Vector3d(0, 0, 4).asDiagonal();
  const Eigen::Matrix3d turned = here.covariance_in(there, up_only);
  EXPECT_NEAR(turned(0, 0), 4.0, 1e-12);
  EXPECT_NEAR(turned(2, 2), 0.0, 1e-12);
}

}  // namespace
}  // namespace anchord::enu_test
