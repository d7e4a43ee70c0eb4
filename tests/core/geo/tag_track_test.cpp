#include "core/geo/tag_track.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace anchord::tag_track_test {
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
// Epochs at 10 Hz with two pauses, the longer of them most of the flight, and one epoch by itself.
TEST(TagTrack, FindsTheNeighboursOfEveryInstantHoweverUnevenTheTrackIs) {
  std::vector<double> times_s{0};
  for (int i = 0; i < 40; ++i) times_s.push_back(3 + 0.1 * i);
  for (int i = 0; i < 300; ++i) times_s.push_back(4000 + 0.1 * i + 0.03 * (i % 3));
  std::vector<Fix> fixes;
  for (const double t_s : times_s) fixes.push_back(fix_at(t_s, {std::sin(t_s), std::cos(t_s), t_s}));
  TrackOptions any_gap;
  any_gap.max_gap_s = 1e6;
  const TagTrack track(fixes, std::nullopt, UtcTime{}, any_gap);
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    const double from_s = times_s[i - 1], to_s = times_s[i];
    for (const double share : {0.0, 1e-9, 0.25, 0.5, 1 - 1e-9}) {
      const double t_s = from_s + share * (to_s - from_s), part = (t_s - from_s) / (to_s - from_s);
      const TagPoint point = track.at(t_s);
      ASSERT_EQ(point.refused, TrackRefusal::none) << t_s;
      EXPECT_NEAR(point.position_m.x(), (1 - part) * std::sin(from_s) + part * std::sin(to_s), 1e-9) << t_s;
      EXPECT_NEAR(point.velocity_mps.z(), 1, 1e-6) << t_s;
    }
  }
  EXPECT_EQ(track.at(times_s.back()).refused, TrackRefusal::none);
  EXPECT_EQ(track.at(-1e-9).refused, TrackRefusal::outside);
  EXPECT_EQ(track.at(times_s.back() + 1e-6).refused, TrackRefusal::outside);
}

}  // namespace anchord::tag_track_test
