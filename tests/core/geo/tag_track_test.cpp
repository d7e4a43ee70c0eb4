#include "core/geo/tag_track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace anchord {
namespace {

Fix fix_at(double t_s, Eigen::Vector3d at, FixClass quality = FixClass::rtk_fixed,
           std::optional<double> yaw_deg = std::nullopt) {
  Fix fix;
  fix.time = UtcTime::from_seconds(t_s);
  fix.frame = TrackFrame::local;
  fix.local_m = at;
  fix.fix = quality;
  if (yaw_deg) {
    fix.enu_from_body =
        Eigen::Quaterniond(Eigen::AngleAxisd(*yaw_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()));
  }
  return fix;
}

TEST(TagTrack, InterpolatesPositionByTimeAndAttitudeOnTheSphere) {
  const std::vector<Fix> fixes{fix_at(0, {0, 0, 0}, FixClass::rtk_fixed, 0),
                               fix_at(0.2, {2, 0, 1}, FixClass::rtk_fixed, 90)};
  const TagTrack track(fixes, std::nullopt, UtcTime{}, {.max_gap_s = 1.0});
  const TagPoint point = track.at(0.1, {1, 0, 0});
  ASSERT_EQ(point.refused, TrackRefusal::none);
  // Half way: (1, 0, 0.5), and the arm of 1 m turned by 45 degrees.
  EXPECT_LT((point.position_m - Eigen::Vector3d(1 + std::sqrt(0.5), std::sqrt(0.5), 0.5)).norm(), 1e-12);
}

TEST(TagTrack, NeverExtrapolates) {
  const std::vector<Fix> fixes{fix_at(1, {0, 0, 0}), fix_at(1.1, {1, 0, 0})};
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  EXPECT_EQ(track.at(0.999).refused, TrackRefusal::outside);
  EXPECT_EQ(track.at(1.101).refused, TrackRefusal::outside);
  EXPECT_EQ(track.at(1.1).refused, TrackRefusal::none);
}

TEST(TagTrack, RefusesAGapLongerThanTheLimit) {
  const std::vector<Fix> fixes{fix_at(0, {0, 0, 0}), fix_at(0.6, {1, 0, 0}), fix_at(0.7, {1, 0, 0})};
  const TagTrack track(fixes, std::nullopt, UtcTime{}, {.max_gap_s = 0.5});
  EXPECT_EQ(track.at(0.3).refused, TrackRefusal::gap);
  EXPECT_EQ(track.at(0.65).refused, TrackRefusal::none);
}

TEST(TagTrack, RefusesWhenEitherNeighbourIsNotFixed) {
  const std::vector<Fix> fixes{fix_at(0, {0, 0, 0}), fix_at(0.1, {1, 0, 0}, FixClass::rtk_float),
                               fix_at(0.2, {2, 0, 0})};
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  EXPECT_EQ(track.at(0.05).refused, TrackRefusal::fix_class);
  EXPECT_EQ(track.at(0.15).refused, TrackRefusal::fix_class);
}

TEST(TagTrack, TakesRowsInAnyOrderAndTheBetterOfTwoAtOneInstant) {
  const std::vector<Fix> fixes{fix_at(0.2, {2, 0, 0}), fix_at(0.1, {9, 9, 9}, FixClass::rtk_float),
                               fix_at(0, {0, 0, 0}), fix_at(0.1, {1, 0, 0})};
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  ASSERT_EQ(track.poses().size(), 3U);
  EXPECT_NEAR(track.at(0.15).position_m.x(), 1.5, 1e-12);
}

TEST(TagTrack, KeepsTheNeighboursCovarianceBetweenThem) {
  std::vector<Fix> fixes{fix_at(0, {0, 0, 0}), fix_at(0.1, {0, 0, 0})};
  fixes[0].covariance_m2 = Eigen::Matrix3d::Identity() * 1.0;
  fixes[1].covariance_m2 = Eigen::Matrix3d::Identity() * 3.0;
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  // Not 1.0: neighbouring errors are the same error. What the line between them may miss comes on top.
  const double missed_m = track.interpolation_error().sigma_m(0.1, 0.5);
  EXPECT_NEAR(track.at(0.05).covariance_m2(1, 1), 2.0 + missed_m * missed_m, 1e-9);
  EXPECT_NEAR(track.at(0.0).covariance_m2(1, 1), 1.0, 1e-9);
}

TEST(TagTrack, AssumesTheDissertationsRtkVarianceWhereTheSourceGivesNone) {
  const std::vector<Fix> fixes{fix_at(0, {0, 0, 0}), fix_at(0.1, {0, 0, 0})};
  const TagTrack track(fixes, std::nullopt, UtcTime{});
  EXPECT_NEAR(track.at(0.1).covariance_m2(0, 0), 400e-6, 1e-12);  // 400 mm^2, section 7.2.3
}

TEST(TagTrack, LeavesOutPosesThatAreNotFinite) {
  const std::vector<Fix> fixes{fix_at(0, {0, 0, 0}), fix_at(0.1, {std::nan(""), 0, 0}),
                               fix_at(0.2, {2, 0, 0})};
  const TagTrack track(fixes, std::nullopt, UtcTime{}, {.max_gap_s = 0.5});
  EXPECT_NEAR(track.at(0.1).position_m.x(), 1.0, 1e-12);
}

}  // namespace
}  // namespace anchord
