// Surveyed points beside the answer: closed forms.
#include "core/localize/check_points.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace anchord::check_points_test {
namespace {

CheckPoint point(std::uint32_t id, double off_m, double solved_m = 0.04, double surveyed_m = 0.03) {
  CheckPoint p;
  p.anchor = NetworkId{id};
  p.solved = {{10 + off_m, 5, 2}, Eigen::Matrix3d::Identity() * solved_m * solved_m};
  p.surveyed = {{10, 5, 2}, Eigen::Matrix3d::Identity() * surveyed_m * surveyed_m};
  return p;
}

TEST(CheckPoints, AreHeldAgainstBothCovariances) {
  // 0.04 and 0.03 m: 0.05 m together; 0.1 m is 2 sigma: chi2 4, of which chance with three degrees is 0.2615.
  const auto report = check_against(std::vector{point(1, 0.1)});
  ASSERT_EQ(report.points.size(), 1u);
  EXPECT_NEAR(report.points[0].chi2, 4, 1e-9);
  EXPECT_NEAR(report.points[0].p_value, 0.2615, 1e-4);
  EXPECT_TRUE(report.points[0].agrees);
  EXPECT_FALSE(report.shift.has_value()) << "one alone has nothing in common";
  EXPECT_FALSE(check_against(std::vector{point(1, 0.25)}).points[0].agrees);
}

TEST(CheckPoints, ShowWhatAllAreOffAlike) {
  const auto report = check_against(std::vector{point(1, 0.30), point(2, 0.34), point(3, 0.32)});
  ASSERT_TRUE(report.shift.has_value());
  EXPECT_NEAR(report.shift->shift_m.x(), 0.32, 1e-9);
  // Errors of one flight are common: three points are no surer than one.
  EXPECT_NEAR(report.shift->covariance_m2(0, 0), 0.0025, 1e-12);
  EXPECT_TRUE(report.shift->significant);
  EXPECT_FALSE(check_against(std::vector{point(1, 0.1), point(2, -0.1)}).shift->significant);
}

TEST(CheckPoints, WithoutHeightCountInThePlane) {
  CheckPoint flat = point(1, 0.1);
  flat.plane = true;
  flat.surveyed.at_m.z() = 50;
  const auto report = check_against(std::vector{flat});
  EXPECT_NEAR(report.points[0].chi2, 4, 1e-9);
  EXPECT_NEAR(report.points[0].p_value, std::exp(-2.0), 1e-12);
}

TEST(CheckPoints, WithoutUsableCovarianceAreLeftOut) {
  CheckPoint broken = point(1, 0.1);
  broken.solved.covariance_m2.setConstant(NAN);
  EXPECT_TRUE(check_against(std::vector{broken}).points.empty());
  EXPECT_TRUE(check_against({}).points.empty());
}

}  // namespace
}  // namespace anchord::check_points_test
