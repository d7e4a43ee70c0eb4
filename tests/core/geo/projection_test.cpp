#include "core/geo/projection.hpp"

#include <gtest/gtest.h>

#include <GeographicLib/UTMUPS.hpp>
#include <filesystem>
#include <fstream>

#include "core/geo/geoid.hpp"

namespace anchord::projection_test {
namespace {

constexpr double degrees(double d, double m, double s) { return d + m / 60 + s / 3600; }

TEST(Projection, GivesTheBritishNationalGridExampleOfEpsg) {
  // IOGP Guidance Note 7-2, section 3.5.3.1 (Transverse Mercator): OSGB 36 50 30'N 0 30'E ->
  // E 577274.99, N 69740.50.
  const auto grid = Projection::open(27700, 4277);
  ASSERT_TRUE(grid.has_value()) << grid.error().message;
  const auto at = grid.value().easting_northing_m({50.5, 0.5, 0});
  ASSERT_TRUE(at.has_value());
  EXPECT_NEAR(at.value().x(), 577274.99, 0.01);
  EXPECT_NEAR(at.value().y(), 69740.50, 0.01);
}

TEST(Projection, GivesTheJamaicanLambertExampleOfEpsg) {
  // IOGP Guidance Note 7-2, Lambert Conic Conformal (1SP): JAD69 17 55'55.80"N 76 56'37.26"W ->
  // E 255966.58, N 142493.51.
  const auto lambert = Projection::open(24200, 4242);
  ASSERT_TRUE(lambert.has_value()) << lambert.error().message;
  const auto at = lambert.value().easting_northing_m({degrees(17, 55, 55.80), -degrees(76, 56, 37.26), 0});
  ASSERT_TRUE(at.has_value());
  EXPECT_NEAR(at.value().x(), 255966.58, 0.01);
  EXPECT_NEAR(at.value().y(), 142493.51, 0.01);
}

TEST(Projection, AgreesWithAnotherLibraryInUtmAndComesBack) {
  const auto utm = Projection::open(32631, 4979);
  ASSERT_TRUE(utm.has_value()) << utm.error().message;
  EXPECT_EQ(utm.value().name(), "WGS 84 / UTM zone 31N");
  const Wgs84 place{51.023123457, 3.713123457, 58.4};
  const auto at = utm.value().easting_northing_m(place);
  ASSERT_TRUE(at.has_value());
  int zone = 0;
  bool north = false;
  double easting = 0, northing = 0;
  GeographicLib::UTMUPS::Forward(place.lat_deg, place.lon_deg, zone, north, easting, northing);
  EXPECT_EQ(zone, 31);
  EXPECT_NEAR(at.value().x(), easting, 1e-6);
  EXPECT_NEAR(at.value().y(), northing, 1e-6);
  const auto back = utm.value().geographic(at.value(), 58.4);
  ASSERT_TRUE(back.has_value());
  EXPECT_NEAR(back.value().lat_deg, place.lat_deg, 1e-11);
  EXPECT_NEAR(back.value().lon_deg, place.lon_deg, 1e-11);
}

TEST(Projection, RefusesWhatIsNoMap) {
  EXPECT_EQ(Projection::open(999999, 4937).error().code, Errc::not_found);
  EXPECT_EQ(Projection::open(4326, 4937).error().code, Errc::invalid_argument);
  EXPECT_EQ(Projection::open(31300, 4313).error().code, Errc::unsupported);  // PROJ is 745 m off there
  const auto utm = Projection::open(25831, 4937);
  ASSERT_TRUE(utm.has_value());
  EXPECT_FALSE(utm.value().easting_northing_m({91, 0, 0}).has_value());
}

// Eastings in feet, or counted west, would be taken for metres east by every drawing and table made of them.
TEST(Projection, GivesMetresEastAndNorthOrSaysWhyNot) {
  struct Case {
    int epsg, own_datum;
    Wgs84 at;
    const char* says;
  };
  for (const auto& [epsg, own_datum, at, says] :
       {Case{2225, 4269, {40.5, -122.3, 0}, "counts in US survey foot"},
        Case{2048, 4148, {-33.9, 18.4, 0}, "south and west"},
        Case{5513, 4156, {50.08, 14.42, 0}, "south and west"}}) {
    const auto map = Projection::open(epsg, own_datum);
    ASSERT_TRUE(map.has_value()) << epsg << map.error().message;
    const auto got = map.value().easting_northing_m(at);
    ASSERT_FALSE(got.has_value()) << epsg << ": " << got.value().transpose();
    EXPECT_NE(got.error().message.find(says), std::string::npos) << got.error().message;
    EXPECT_TRUE(map.value().geographic({1000, 1000}, 0).has_value()) << "pictures come with its own numbers";
  }
  // gdaltransform -s_srs EPSG:4979 -t_srs EPSG:... -output_xy
  for (const auto& [epsg, at, e_m, n_m] :
       {std::tuple{3031, Wgs84{-77.85, 166.67, 0}, 305467.1627, -1289201.5377},
        {5041, {89.9995, 20, 0}, 2000018.9862, 1999947.8359},
        {2193, {-41.3, 174.8, 0}, 1750697.5213, 5426376.6232}}) {
    const auto map = Projection::open(epsg, epsg == 2193 ? 4959 : 4979);
    ASSERT_TRUE(map.has_value()) << epsg << map.error().message;
    const auto got = map.value().easting_northing_m(at);
    ASSERT_TRUE(got.has_value()) << epsg << got.error().message;
    EXPECT_NEAR(got.value().x(), e_m, 0.01) << epsg;
    EXPECT_NEAR(got.value().y(), n_m, 0.01) << epsg;
  }
}

TEST(Projection, KnowsDatumsByTheirWordsAndNothingByGuess) {
  EXPECT_EQ(geographic_epsg("ETRS89"), 4937);
  EXPECT_EQ(geographic_epsg("WGS 84"), 4979);
  EXPECT_EQ(geographic_epsg("ITRF2014 (2026.3)"), 7912);
  EXPECT_FALSE(geographic_epsg("").has_value());
  EXPECT_FALSE(geographic_epsg("our own").has_value());
}

TEST(Projection, ReadsTheEpochBehindADatum) {
  EXPECT_EQ(stated_epoch_year("ITRF2014 (2026.3)"), 2026.3);
  EXPECT_EQ(stated_epoch_year("ITRF2014 (2026.3)", 2020.5), 2020.5) << "given apart, it is the newer word";
  EXPECT_FALSE(stated_epoch_year("ITRF2014").has_value());
  EXPECT_FALSE(stated_epoch_year("NAD83(2011)").has_value());
  EXPECT_FALSE(stated_epoch_year("ITRF2014 (soon)").has_value());
}

// Without Ordnance Survey's grid the change from ETRS89 is metres off; a null transformation from WGS 84 is
// up to 1 m.
TEST(Projection, RefusesAChangeOfDatumWithAnErrorOfMoreThanHalfAMetreBothWays) {
  const Wgs84 caister{52.6580078333, 1.7160739722, 108.05};
  for (const auto& [epsg, geographic] : {std::pair{27700, 4937}, {31467, 4937}, {25831, 4979}}) {
    const auto map = Projection::open(epsg, geographic);
    ASSERT_TRUE(map.has_value()) << map.error().message;
    const auto there = map.value().easting_northing_m(caister);
    ASSERT_FALSE(there.has_value()) << epsg << ": " << there.value().transpose();
    EXPECT_NE(there.error().message.find("(limit 0.5 m)"), std::string::npos) << there.error().message;
    EXPECT_FALSE(map.value().geographic({500'000, 300'000}, 0).has_value()) << epsg;
  }
  EXPECT_TRUE(Projection::open(25831, 4937).value().easting_northing_m(caister).has_value());
}

TEST(Projection, TakesPositionsOfNoStatedDatumInTheOwnOneOfTheMap) {
  const Wgs84 place{51.0231, 3.7133, 55};
  const auto own = Projection::open_own(25831), stated = Projection::open(25831, 4937);
  ASSERT_TRUE(own.has_value() && stated.has_value());
  EXPECT_EQ(own.value().easting_northing_m(place).value(), stated.value().easting_northing_m(place).value());
  EXPECT_FALSE(Projection::open_own(27700).value().easting_northing_m({52.6, 1.7, 0}).has_value());
}

// echo 51.0231 3.7133 55 2026.9 | cs2cs -d 4 EPSG:7912 EPSG:25831, of PROJ 9.1.1
TEST(Projection, MovesPositionsOfAFrameThatMovesToTheEpochOfTheMap) {
  const Wgs84 place{51.0231, 3.7133, 55};
  const auto map = Projection::open(25831, 7912, 2026.9);
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const auto at = map.value().easting_northing_m(place);
  ASSERT_TRUE(at.has_value()) << at.error().message;
  EXPECT_NEAR(at.value().x(), 550026.178, 1e-3);
  EXPECT_NEAR(at.value().y(), 5652635.171, 1e-3);
  const auto back = map.value().geographic(at.value(), 55);
  ASSERT_TRUE(back.has_value()) << back.error().message;
  EXPECT_NEAR(back.value().lat_deg, place.lat_deg, 1e-8);
  EXPECT_NEAR(back.value().lon_deg, place.lon_deg, 1e-8);
}

TEST(Projection, AsksForTheEpochOfAFrameThatMoves) {
  const auto map = Projection::open(25831, 7912);
  ASSERT_TRUE(map.has_value()) << map.error().message;
  const auto at = map.value().easting_northing_m({51.0231, 3.7133, 55});
  ASSERT_FALSE(at.has_value());
  EXPECT_NE(at.error().message.find("crs.epoch"), std::string::npos) << at.error().message;
}

// WGS 84 is kept at the ITRF to 2 cm: expected are the figures of GeographicLib's TransverseMercator for WGS
// 84 itself, in whatever year.
TEST(Projection, TakesAMapInWgs84ForAFrameOfTheItrfAsItIsAndForNoOther) {
  const Wgs84 place{51.0231, 3.7133, 55};
  int zone = 0;
  bool north = false;
  double easting_m = 0, northing_m = 0;
  GeographicLib::UTMUPS::Forward(place.lat_deg, place.lon_deg, zone, north, easting_m, northing_m);
  for (const int itrf : {7911, 7912, 9989, 9018})
    for (const auto& year : {std::optional<double>(), std::optional(2026.9)}) {
      const auto map = Projection::open(32631, itrf, year);
      ASSERT_TRUE(map.has_value()) << itrf << map.error().message;
      const auto at = map.value().easting_northing_m(place);
      ASSERT_TRUE(at.has_value()) << itrf << at.error().message;
      EXPECT_NEAR(at.value().x(), easting_m, 1e-6) << itrf;
      EXPECT_NEAR(at.value().y(), northing_m, 1e-6) << itrf;
    }
  EXPECT_FALSE(Projection::open(32631, 4937).value().easting_northing_m(place).has_value())
      << "ETRS89 is 0.8 m away";
}

/// A geoid of one height in GeographicLib's PGM format: raw = (height - offset) / scale.
void write_geoid(const std::filesystem::path& file, double height_m) {
  std::ofstream out(file, std::ios::binary);
  out << "P5\n# Geoid file in PGM format for the GeographicLib::Geoid class\n# Description test\n"
         "# Offset -108\n# Scale 0.003\n# Origin 90N 0E\n# AREA_OR_POINT Point\n8 5\n65535\n";
  const auto raw = static_cast<unsigned>(std::lround((height_m + 108) / 0.003));
  for (int i = 0; i < 40; ++i) out << static_cast<char>(raw >> 8U) << static_cast<char>(raw & 0xffU);
}

TEST(Geoid, SaysThatThereIsNoneAndWhatWouldInstallOne) {
  const auto none = Geoid::open("/nonexistent");
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().code, Errc::not_found);
  EXPECT_NE(none.error().message.find("geographiclib-get-geoids"), std::string::npos);
}

TEST(Geoid, ReadsTheHeightOfAnInstalledFile) {
  char folder[] = "/tmp/anchord_geoid_XXXXXX";
  ASSERT_NE(mkdtemp(folder), nullptr);
  const std::filesystem::path dir(folder);
  write_geoid(dir / "egm96-15.pgm", 43.5);
  const auto geoid = Geoid::open(dir.string());
  ASSERT_TRUE(geoid.has_value()) << geoid.error().message;
  EXPECT_EQ(geoid.value().name(), "EGM96");
  const auto height = geoid.value().undulation_m({51, 3.7, 58.4});
  ASSERT_TRUE(height.has_value());
  EXPECT_NEAR(height.value(), 43.5, 1e-9);
  EXPECT_FALSE(geoid.value().undulation_m({91, 0, 0}).has_value());
  std::ofstream(dir / "egm2008-1.pgm") << "P5\nbroken";
  EXPECT_EQ(Geoid::open(dir.string()).error().code, Errc::bad_frame);
  std::filesystem::remove_all(dir);
}

}  // namespace
}  // namespace anchord::projection_test
