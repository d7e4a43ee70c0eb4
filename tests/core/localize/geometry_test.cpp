#include "core/localize/geometry.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/localize/error_ellipse.hpp"
#include "tests/core/localize/support.hpp"

namespace anchord::geometry_test {
namespace {

const Eigen::Vector3d k_anchor(3, 8, 2);

GeometryKind kind(const Eigen::Vector3d& half_box_m, Dims dims = Dims::three) {
  std::mt19937_64 random(7);
  return assess_geometry(testing::ranges_from_box(random, k_anchor, 200, half_box_m, 0), dims).kind;
}

TEST(Geometry, TellsLinePlaneAndVolumeApart) {
  EXPECT_EQ(kind({10, 0, 0}), GeometryKind::collinear);
  EXPECT_EQ(kind({10, 0.3, 0.3}), GeometryKind::collinear);
  EXPECT_EQ(kind({10, 8, 0}), GeometryKind::coplanar);
  EXPECT_EQ(kind({10, 8, 5}), GeometryKind::good);
}

TEST(Geometry, AsksNoHeightInTwoDimensions) {
  EXPECT_EQ(kind({10, 8, 0}, Dims::two), GeometryKind::good);
  EXPECT_EQ(kind({10, 0, 5}, Dims::two), GeometryKind::collinear);
}

TEST(Geometry, CountsPlacesNotRepeats) {
  std::mt19937_64 random(3);
  auto rows = testing::ranges_from_box(random, k_anchor, 3, {5, 5, 5}, 0);
  const auto three = rows;
  for (int i = 0; i < 50; ++i) rows.insert(rows.end(), three.begin(), three.end());
  const auto report = assess_geometry(rows);
  EXPECT_EQ(report.kind, GeometryKind::too_few);
  EXPECT_NE(report.reason.find("3 distinct places"), std::string::npos) << report.reason;
}

TEST(Geometry, ToleratesNanRows) {
  std::mt19937_64 random(3);
  auto rows = testing::ranges_from_box(random, k_anchor, 60, {5, 5, 5}, 0);
  rows[0].distance_m = std::nan("");
  rows[1].tag_m.x() = std::nan("");
  EXPECT_EQ(assess_geometry(rows).kind, GeometryKind::good);
  EXPECT_EQ(assess_geometry({}).kind, GeometryKind::too_few);
}

TEST(Geometry, MirrorsThroughTheFlattestPlane) {
  std::mt19937_64 random(9);
  const auto rows = testing::ranges_from_box(random, k_anchor, 500, {10, 8, 0}, 0);
  const Eigen::Vector3d mirror = track_shape(rows).mirrored(k_anchor);
  EXPECT_LT((mirror - Eigen::Vector3d(3, 8, -2)).norm(), 1e-9);
}

TEST(ErrorEllipse, GivesTheTextbookAxesOfADiagonalCovariance) {
  // chi-square 95 %: 5.991 for two degrees of freedom, 1.960^2 for one.
  const ErrorEllipse e = error_ellipse(Eigen::Vector3d(0.01, 0.04, 0.09).asDiagonal());
  EXPECT_NEAR(e.major_m, 0.2 * std::sqrt(5.991), 1e-4);
  EXPECT_NEAR(e.minor_m, 0.1 * std::sqrt(5.991), 1e-4);
  EXPECT_NEAR(e.azimuth_deg, 0.0, 1e-9);  // the long axis points north
  EXPECT_NEAR(e.v95_m, 0.3 * 1.960, 1e-4);
}

TEST(ErrorEllipse, TurnsClockwiseFromNorth) {
  Eigen::Matrix3d c = Eigen::Matrix3d::Zero();
  c(0, 0) = c(1, 1) = 1;
  c(0, 1) = c(1, 0) = 0.9;  // north-east
  EXPECT_NEAR(error_ellipse(c).azimuth_deg, 45.0, 1e-9);
  c(0, 1) = c(1, 0) = -0.9;  // north-west
  EXPECT_NEAR(error_ellipse(c).azimuth_deg, 135.0, 1e-9);
}

}  // namespace
}  // namespace anchord::geometry_test
