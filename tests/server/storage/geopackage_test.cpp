// What is in the file, byte for byte where the standard says it (OGC 12-128r17); GDAL reads one in
// tests/e2e/neighbours.test.mjs.
#include "server/storage/geopackage.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>

namespace anchord::geopackage_test {
namespace {

FeatureTable points(std::vector<FeatureTable::Row> rows) {
  FeatureTable table;
  table.name = "points";
  table.columns = {{"name"}, {"metres", FeatureTable::Type::real}};
  table.rows = std::move(rows);
  return table;
}

TEST(GeoPackage, SaysInItsHeaderWhatItIs) {
  const std::array tables{points({})};
  const auto file = geopackage(tables, UtcTime::from_us(1777889472345678));
  ASSERT_TRUE(file) << file.error().message;
  const auto& bytes = file.value();
  EXPECT_EQ(bytes.substr(0, 16), std::string("SQLite format 3\0", 16));
  EXPECT_EQ(bytes.substr(68, 4), "GPKG") << "application_id, requirement 2";
  EXPECT_EQ(bytes.substr(60, 4), std::string("\0\0\x28\x3c", 4)) << "user_version 10300";
}

// GeoPackageBinary of POINT Z (1 2 3): by clause 2.1.3 and the WKB of ISO 13249-3, written by hand.
TEST(GeoPackage, WritesPointsAsTheStandardHasThem) {
  const std::array tables{points({{{{1, 2, 3}}, {std::string("a"), 0.5}}})};
  const auto file = geopackage(tables, UtcTime{});
  ASSERT_TRUE(file) << file.error().message;
  const std::string blob(
      "GP\0\1\x73\x13\0\0\1\xe9\3\0\0\0\0\0\0\0\0\xf0\x3f\0\0\0\0\0\0\0\x40\0\0\0\0\0\0\x08\x40", 37);
  EXPECT_NE(file.value().find(blob), std::string::npos);
}

TEST(GeoPackage, TakesNamesAndTextsThatLookLikeSql) {
  auto table = points({{{}, {std::string("'); DROP TABLE gpkg_contents; --"), {}}}});
  table.name = "a\"b";
  const std::array tables{table};
  const auto file = geopackage(tables, UtcTime{});
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_NE(file.value().find("'); DROP TABLE gpkg_contents; --"), std::string::npos);
}

TEST(GeoPackage, RefusesARowThatDoesNotFitItsColumns) {
  const std::array tables{points({{{{1, 2, 3}}, {0.5}}})};
  EXPECT_THROW((void)geopackage(tables, UtcTime{}), std::logic_error);
}

}  // namespace
}  // namespace anchord::geopackage_test
