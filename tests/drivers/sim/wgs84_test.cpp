#include "drivers/sim/wgs84.hpp"

#include <gtest/gtest.h>

#include <GeographicLib/LocalCartesian.hpp>

namespace anchord::sim::wgs84_test {
namespace {

TEST(SimulatedGlobe, AgreesWithGeographicLibToAMicrometre) {
  for (const Wgs84 origin : {Wgs84{51.0231, 3.7131, 55.5}, Wgs84{-33.9, 151.2, 0}, Wgs84{0, -179.9999, 8000},
                             Wgs84{89.9, 12, 10}}) {
    const GeographicLib::LocalCartesian reference(origin.lat_deg, origin.lon_deg, origin.height_m);
    for (const Eigen::Vector3d& enu_m :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(30, 20, 8), Eigen::Vector3d(-9000, 4000, 120)}) {
      const Wgs84 at = wgs84_from_enu(origin, enu_m);
      Eigen::Vector3d back_m;
      reference.Forward(at.lat_deg, at.lon_deg, at.height_m, back_m.x(), back_m.y(), back_m.z());
      EXPECT_LT((back_m - enu_m).norm(), 1e-6);  // degrees as doubles resolve 2 nm here
    }
  }
}

}  // namespace
}  // namespace anchord::sim::wgs84_test
