#include "core/geo/source_crs.hpp"

#include <gtest/gtest.h>

#include <GeographicLib/UTMUPS.hpp>
#include <cmath>
#include <numbers>

#include "core/geo/enu.hpp"

namespace anchord::source_crs_test {
namespace {

SourceCrs opened(const SourceCrsSpec& spec, const Eigen::Vector3d& first) {
  auto crs = SourceCrs::open(spec, first);
  if (!crs) throw std::runtime_error(crs.error().message);
  return std::move(crs).value();
}
std::string why_not(const SourceCrsSpec& spec, const Eigen::Vector3d& first) {
  const auto crs = SourceCrs::open(spec, first);
  return crs ? "" : crs.error().message;
}
double apart_m(const Wgs84& a, const Wgs84& b) { return (ecef_from_wgs84(a) - ecef_from_wgs84(b)).norm(); }

/// Eastings and northings of another library, 2.6 degrees off the central meridian of zone 32.
Eigen::Vector3d utm32(double lat_deg, double lon_deg, double* convergence_deg = nullptr) {
  int zone = 0;
  bool north = false;
  double easting = 0, northing = 0, gamma = 0, scale = 0;
  GeographicLib::UTMUPS::Forward(lat_deg, lon_deg, zone, north, easting, northing, gamma, scale, 32);
  if (convergence_deg != nullptr) *convergence_deg = gamma;
  return {easting, northing, 565.25};
}

TEST(SourceCrs, TakesUtmBackToTheGlobeAsAnotherLibraryDoes) {
  for (const char* crs : {"EPSG:25832", "25832", "EPSG:32632", "UTM 32N", "utm zone 32n"}) {
    const auto map = opened({crs}, utm32(48.137154, 11.576124));
    EXPECT_EQ(map.datum_error_m(), 0) << crs;  // each in its own datum
    const auto place = map.wgs84(utm32(48.137154, 11.576124));
    ASSERT_TRUE(place.has_value()) << crs;
    EXPECT_LT(apart_m(place.value(), {48.137154, 11.576124, 565.25}), 1e-3)
        << crs;  // the ellipsoids of WGS84 and ETRS89 are 0.1 mm apart
  }
  EXPECT_EQ(opened({"EPSG:25832"}, utm32(48.1, 11.5)).datum(), "ETRS89");
  EXPECT_EQ(opened({"EPSG:32632"}, utm32(48.1, 11.5)).datum(), "WGS 84");
}

TEST(SourceCrs, HonoursTheScaleAndTheConvergenceOfTheMap) {
  // On the central meridian 100 m of the map are 100.04 m of ground (scale 0.9996).
  const Eigen::Vector3d on_meridian(500000, 5334000, 0), east_of_it(500100, 5334000, 0);
  const auto middle = opened({"EPSG:25832"}, on_meridian);
  const double ground_m = apart_m(middle.wgs84(on_meridian).value(), middle.wgs84(east_of_it).value());
  EXPECT_NEAR(ground_m, 100.0 / 0.9996, 1e-3);
  // Away from it grid north is 1.92 degrees east of true north: GeographicLib's convergence.
  double convergence_deg = 0;
  const auto at = utm32(48.137154, 11.576124, &convergence_deg);
  EXPECT_GT(convergence_deg, 1.9);
  EXPECT_NEAR(opened({"EPSG:25832"}, at).convergence_rad(at) * 180 / std::numbers::pi, convergence_deg, 1e-3);
}

TEST(SourceCrs, GivesWhatGdaltransformGivesForNationalGrids) {
  // gdaltransform -s_srs EPSG:4937 -t_srs EPSG:2056 (PROJ 9.1, Debian 12) of 7.438632 46.951083 550.1;
  // swisstopo's old observatory of Bern is E 2600000, N 1200000.
  const Eigen::Vector3d bern(2599999.96229147, 1200000.0137035, 550.1);
  const auto swiss = opened({"EPSG:2056"}, bern);
  EXPECT_EQ(swiss.datum(), "ETRS89");
  EXPECT_NEAR(swiss.datum_error_m(), 0.1, 1e-9);
  EXPECT_LT(apart_m(swiss.wgs84(bern).value(), {46.951083, 7.438632, 550.1}),
            2e-3);  // the 50 m between the two ellipsoids tilt it by 1 mm
}

TEST(SourceCrs, RefusesAChangeOfDatumThatIsWorseThanTheLimitUnlessItIsAccepted) {
  // Without the national grid the British datum is left by seven parameters, 2 m.
  const Eigen::Vector3d london(530000, 180000, 50);
  EXPECT_NE(why_not({"EPSG:27700"}, london).find("error of 2 m (limit 0.5 m)"), std::string::npos)
      << why_not({"EPSG:27700"}, london);
  SourceCrsSpec accepted{"EPSG:27700"};
  accepted.max_datum_error_m = 3;
  // gdaltransform -s_srs EPSG:27700 -t_srs EPSG:4979
  EXPECT_LT(
      apart_m(opened(accepted, london).wgs84(london).value(), {51.5039908230887, -0.128353926492304, 50}),
      0.01);
}

TEST(SourceCrs, TakesEarthCentredCoordinates) {
  // gdaltransform -s_srs EPSG:4979 -t_srs EPSG:4978 of 11.576124 48.137154 565.25
  const Eigen::Vector3d at(4178000.12313598, 855806.019376419, 4727488.21873881);
  EXPECT_LT(apart_m(opened({"ECEF"}, at).wgs84(at).value(), {48.137154, 11.576124, 565.25}), 1e-5);
  EXPECT_NE(why_not({"ECEF"}, {691650, 5334754, 565}).find("outside"), std::string::npos);
}

TEST(SourceCrs, MakesHeightsAboveTheEllipsoid) {
  const Eigen::Vector3d at(11.576124, 48.137154, 520);
  SourceCrsSpec spec{"EPSG:4326"};
  ASSERT_TRUE(read_heights("EPSG:5773", spec));
  // gdaltransform -s_srs EPSG:4326+5773 -t_srs EPSG:4979
  const auto egm96 = opened(spec, at);
  EXPECT_NEAR(egm96.wgs84(at).value().height_m, 565.53273893789, 1e-3);
  EXPECT_EQ(egm96.heights(), "above the ellipsoid, computed from EGM96 height (error 1 m)");
  ASSERT_TRUE(read_heights("45.6", spec));
  EXPECT_NEAR(opened(spec, at).wgs84(at).value().height_m, 565.6, 1e-9);
  ASSERT_TRUE(read_heights("ellipsoidal", spec));
  EXPECT_NEAR(opened(spec, at).wgs84(at).value().height_m, 520, 1e-9);
  EXPECT_FALSE(read_heights("sea level", spec));
  EXPECT_FALSE(read_heights("4730", spec));
  // A system of heights whose grid is not in Debian.
  ASSERT_TRUE(read_heights("EPSG:7837", spec));
  EXPECT_NE(why_not(spec, at).find("no grid is installed"), std::string::npos) << why_not(spec, at);
}

TEST(SourceCrs, RefusesAnotherZoneAndExchangedAxes) {
  EXPECT_NE(why_not({"EPSG:2056"}, {691650, 5334754, 565}), "");
  EXPECT_NE(why_not({"EPSG:25832"}, {5334754, 691650, 565}), "");
  EXPECT_NE(why_not({"EPSG:4326"}, {691650, 5334754, 565}), "");
  EXPECT_NE(why_not({"EPSG:4326"}, {std::nan(""), 48, 565}), "");
}

TEST(SourceCrs, RefusesWhatIsNoSystemOfPositions) {
  const Eigen::Vector3d at(691650, 5334754, 565);
  for (const char* crs :
       {"", "EPSG:", "UTM 61N", "UTM 32", "EPSG:999999", "EPSG:5773", "Gauss", "EPSG:31300", "EPSG:5555"})
    EXPECT_NE(why_not({crs}, at), "") << crs;
  SourceCrsSpec upright{"EPSG:25832"};
  upright.height_epsg = 25832;
  EXPECT_NE(why_not(upright, at).find("not a vertical system"), std::string::npos);
}

}  // namespace
}  // namespace anchord::source_crs_test
