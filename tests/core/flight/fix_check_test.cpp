// Fixes that come while the rows of a flight are read again.
#include "core/flight/fix_check.hpp"

#include <gtest/gtest.h>

namespace anchord {
namespace {

using flight::FixCheck;

/// At so many metres north of the first place, so many seconds after the first one.
Fix fix_at(double t_s, double north_m) {
  Fix fix;
  fix.frame = TrackFrame::wgs84;
  fix.time.ns = 1'700'000'000'000'000'000 + static_cast<std::int64_t>(t_s * 1e9);
  fix.position = {51.0231 + north_m / 111'270, 3.7131, 60};
  fix.fix = FixClass::rtk_fixed;
  fix.covariance_m2 = Eigen::Vector3d(1e-4, 1e-4, 4e-4).asDiagonal();
  return fix;
}

TEST(FixCheck, BelievesWhereAnAircraftCanHaveComeSinceTheLastFix) {
  FixCheck check(TrackFrame::wgs84, {}, {}, fix_at(0, 0));
  EXPECT_TRUE(check.believes(fix_at(0.1, 0.3)));
  EXPECT_TRUE(check.believes(fix_at(0.2, 0.6)));
  EXPECT_FALSE(check.believes(fix_at(0.3, 400))) << "4 km/s";
  EXPECT_TRUE(check.believes(fix_at(0.4, 1.2)));
}

TEST(FixCheck, BelievesTheFirstFixWhereNoneIsKnown) {
  FixCheck check(TrackFrame::wgs84, {}, {}, std::nullopt);
  EXPECT_TRUE(check.believes(fix_at(0, 0)));
  EXPECT_FALSE(check.believes(fix_at(0.1, 400)));
}

TEST(FixCheck, BelievesNoExcludedRow) {
  Exclusion out;
  out.selection.kind = RowKind::fixes;
  out.selection.since = fix_at(1, 0).time;
  out.selection.until = fix_at(2, 0).time;
  FixCheck check(TrackFrame::wgs84, {}, {out}, fix_at(0, 0));
  EXPECT_TRUE(check.believes(fix_at(0.5, 0.1)));
  EXPECT_FALSE(check.believes(fix_at(1.5, 0.3)));
  EXPECT_TRUE(check.believes(fix_at(2.5, 0.5)));
}

}  // namespace
}  // namespace anchord
