#include "core/planning/gdop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace anchord::planning::gdop_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Eq 8.2-8.5 the slow way: build M, invert M^T M.
template <int Dim>
double rebuilt_trace(const Point<Dim>& anchor, const std::vector<Point<Dim>>& points) {
  Eigen::Matrix<double, Eigen::Dynamic, Dim> m(static_cast<Eigen::Index>(points.size()), Dim);
  for (std::size_t i = 0; i < points.size(); ++i) {
    m.row(static_cast<Eigen::Index>(i)) = (points[i] - anchor).normalized().transpose();
  }
  const Square<Dim> normal = m.transpose() * m;
  return normal.inverse().trace();
}

std::vector<Vector2d> ring(int n, double radius_m) {
  std::vector<Vector2d> out;
  for (int i = 0; i < n; ++i) {
    const double a = 2 * std::numbers::pi * i / n + 0.3;
    out.push_back({radius_m * std::cos(a), radius_m * std::sin(a)});
  }
  return out;
}

// Closed form: N = n/2 I for n >= 3 points spread evenly round the anchor, so tr N^-1 = 4 / n.
TEST(Gdop, IsFourOverNForPointsSpreadEvenlyRoundTheAnchor) {
  for (const int n : {3, 4, 5, 8, 100}) {
    const auto value = gdop(Vector2d{0, 0}, ring(n, 7.0)).value();
    EXPECT_NEAR(value.trace, 4.0 / n, 1e-12) << n;
    EXPECT_NEAR(value.root, 2.0 / std::sqrt(n), 1e-12) << n;
  }
}

// Closed form: two directions at angle a give tr N^-1 = 2 / sin^2 a.
TEST(Gdop, OfTwoDirectionsIsTwoOverSineSquared) {
  for (const double a : {0.01, 0.5, std::numbers::pi / 2, 3.0}) {
    const std::vector<Vector2d> points{{5, 0}, {2 * std::cos(a), 2 * std::sin(a)}};
    EXPECT_NEAR(gdop(Vector2d{0, 0}, points).value().trace * std::pow(std::sin(a), 2), 2.0, 1e-9) << a;
  }
}

// Closed forms: three axes N = I; octahedron N = 2 I; tetrahedron N = 4/3 I.
TEST(Gdop, OfRegularBodiesIsNineOverN) {
  const std::vector<Vector3d> axes{{2, 0, 0}, {0, 3, 0}, {0, 0, 9}};
  EXPECT_NEAR(gdop(Vector3d{0, 0, 0}, axes).value().trace, 3.0, 1e-12);
  const std::vector<Vector3d> octahedron{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  EXPECT_NEAR(gdop(Vector3d{0, 0, 0}, octahedron).value().trace, 1.5, 1e-12);
  const std::vector<Vector3d> tetrahedron{{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  EXPECT_NEAR(gdop(Vector3d{0, 0, 0}, tetrahedron).value().trace, 2.25, 1e-12);
}

// Fig 8.8: from (3, 0) and (2.52, -0.48) the anchor (-1.2, 0) is seen under atan(0.48 / 3.72).
TEST(Gdop, OfTheFirstTwoPointsOfTheDissertationFollowsFromTheirAngle) {
  const double a = std::atan(0.48 / 3.72);
  const std::vector<Vector2d> points{{3, 0}, {2.52, -0.48}};
  EXPECT_NEAR(gdop(Vector2d{-1.2, 0}, points).value().trace, 2 / std::pow(std::sin(a), 2), 1e-9);
}

TEST(Gdop, NamesTooFewPoints) {
  const std::vector<Vector2d> one{{1, 0}};
  const auto value = gdop(Vector2d{0, 0}, one);
  ASSERT_FALSE(value);
  EXPECT_EQ(value.error().code, Errc::too_few_observations);
  EXPECT_THAT(value.error().message, testing::HasSubstr("1, need 2"));
}

TEST(Gdop, NamesSingularGeometryInsteadOfANumber) {
  const std::vector<Vector2d> line{{1, 0}, {2, 0}, {-5, 0}};
  EXPECT_EQ(gdop(Vector2d{0, 0}, line).error().code, Errc::weak_geometry);
  std::vector<Vector3d> plane;  // a flat ring at the anchor's own height says nothing about its height
  for (const auto& p : ring(12, 4.0)) plane.push_back({p.x(), p.y(), 1.5});
  EXPECT_EQ(gdop(Vector3d{0, 0, 1.5}, plane).error().code, Errc::weak_geometry);
  plane.push_back({0, 0, 9});
  EXPECT_TRUE(gdop(Vector3d{0, 0, 1.5}, plane));
}

TEST(Gdop, LeavesOutPointsOnTheAnchorAndNotFiniteOnes) {
  Geometry<2> base({1, 1});
  EXPECT_FALSE(base.add({1, 1}));
  EXPECT_FALSE(base.add({std::nan(""), 1}));
  EXPECT_EQ(base.count(), 0U);
  EXPECT_EQ(base.with({1, 1}).error().code, Errc::too_few_observations);
}

TEST(Gdop, UpdateWorksWhileTheBaseIsStillSingular) {
  Geometry<2> base({0, 0});
  base.add({1, 0});
  EXPECT_NEAR(base.with({0, 4}).value().trace, 2.0, 1e-12);
  EXPECT_EQ(base.with({-3, 0}).error().code, Errc::weak_geometry);
}

template <int Dim>
void compare_with_rebuild(std::uint64_t seed, int cases) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> coordinate(-30, 30);
  std::uniform_int_distribution<int> how_many(Dim - 1, 60);
  const auto draw = [&] {
    Point<Dim> p;
    for (int k = 0; k < Dim; ++k) p[k] = coordinate(random);
    return p;
  };
  for (int i = 0; i < cases; ++i) {
    const Point<Dim> anchor = draw(), candidate = draw();
    std::vector<Point<Dim>> points;
    for (int k = how_many(random); k > 0; --k) points.push_back(draw());
    const Geometry<Dim> base(anchor, points);
    points.push_back(candidate);
    const double expected = rebuilt_trace<Dim>(anchor, points);
    if (expected > 1e6) continue;  // brute force itself has lost its digits there
    EXPECT_NEAR(base.with(candidate).value().trace / expected, 1.0, 1e-9) << "case " << i;
  }
}

TEST(Gdop, UpdateAgreesWithRebuildingAndInvertingInTwoThousandRandomCases) {
  compare_with_rebuild<2>(1, 1000);
  compare_with_rebuild<3>(2, 1000);
}

// Sherman and Morrison: G' = G - G u u^T G / (1 + u^T G u), on a base that can be inverted.
TEST(Gdop, UpdateIsShermanMorrison) {
  const std::vector<Vector3d> points{{4, 1, 0}, {0, 5, 1}, {2, -3, 6}, {-4, 2, 2}};
  const Vector3d anchor{0.5, 0.2, 1}, candidate{6, -2, 3};
  const Geometry<3> base(anchor, points);
  const Eigen::Matrix3d g = base.normal().inverse();
  const Vector3d u = (candidate - anchor).normalized();
  const double expected = g.trace() - (g * u).squaredNorm() / (1 + u.dot(g * u));
  EXPECT_NEAR(base.with(candidate).value().trace, expected, 1e-12);
}

TEST(GdopBatch, AgreesWithOneByOneForEveryLengthAndMarksSingularOnesInfinite) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> coordinate(-10, 10);
  Geometry<3> base({1, 2, 3});
  for (int i = 0; i < 2; ++i) base.add({coordinate(random), coordinate(random), coordinate(random)});
  for (std::size_t size = 0; size < 23; ++size) {
    std::vector<double> x(size), y(size), z(size), trace(size);
    for (std::size_t i = 0; i < size; ++i) {
      x[i] = coordinate(random), y[i] = coordinate(random), z[i] = coordinate(random);
    }
    if (size > 5) x[5] = 1, y[5] = 2, z[5] = 3;  // on the anchor
    if (size > 6) x[6] = std::nan("");
    traces_with(base, x, y, z, trace);
    for (std::size_t i = 0; i < size; ++i) {
      const auto one = base.with({x[i], y[i], z[i]});
      if (one) {
        EXPECT_NEAR(trace[i] / one.value().trace, 1.0,
                    1e-10);  // the base of two points is singular: some digits go
      } else {
        EXPECT_TRUE(std::isinf(trace[i])) << i;
      }
    }
  }
}

TEST(GdopBatch, FlatVersionAgreesWithOneByOne) {
  Geometry<2> base({-1.2, 0});
  base.add({3, 0});
  const std::vector<double> x{2.52, 2.52, 3.48, 3.48, 9}, y{-0.48, 0.48, -0.48, 0, 0};
  std::vector<double> trace(x.size());
  traces_with(base, x, y, trace);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(trace[i], base.with({x[i], y[i]}).value().trace, 1e-9);
  EXPECT_TRUE(std::isinf(trace[3]));  // same line of sight as the only point so far
  EXPECT_TRUE(std::isinf(trace[4]));
}

}  // namespace
}  // namespace anchord::planning::gdop_test
