// Where the aircraft is, told as its fixes arrive.
#include "core/flight/position_watch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "tests/core/localize/flight_support.hpp"
#include "tests/core/localize/spoilt_track.hpp"

namespace anchord::position_watch_test {
namespace {

using flight::FixBelieved;
using flight::FixShown;
using flight::PoseMoved;
using flight::PositionEvent;
using flight::PositionWatch;

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

Mission on_the_globe() {
  Mission mission;
  mission.frame = TrackFrame::wgs84;
  return mission;
}

Exclusion between(double since_s, double until_s) {
  Exclusion out;
  out.selection.kind = RowKind::fixes;
  out.selection.since = fix_at(since_s, 0).time;
  out.selection.until = fix_at(until_s, 0).time;
  return out;
}

template <class Event>
std::size_t count(const std::vector<PositionEvent>& events) {
  return static_cast<std::size_t>(
      std::ranges::count_if(events, [](const auto& e) { return std::holds_alternative<Event>(e); }));
}

bool believes(PositionWatch& watch, const Fix& fix) { return count<FixBelieved>(watch.add(fix)) == 1; }

TEST(PositionWatch, BelievesWhereAnAircraftCanHaveComeSinceTheLastFix) {
  PositionWatch watch(on_the_globe(), {}, {}, {});
  EXPECT_TRUE(believes(watch, fix_at(0, 0))) << "the first one, where none is known";
  EXPECT_TRUE(believes(watch, fix_at(0.1, 0.3)));
  EXPECT_TRUE(believes(watch, fix_at(0.2, 0.6)));
  EXPECT_FALSE(believes(watch, fix_at(0.3, 400))) << "4 km/s";
  EXPECT_TRUE(believes(watch, fix_at(0.4, 1.2)));
}

TEST(PositionWatch, BelievesNoExcludedRow) {
  PositionWatch watch(on_the_globe(), {}, {}, {between(1, 2)});
  EXPECT_TRUE(believes(watch, fix_at(0.5, 0.1)));
  EXPECT_FALSE(believes(watch, fix_at(1.5, 0.3)));
  EXPECT_TRUE(believes(watch, fix_at(2.5, 0.5)));
}

/// An engineer excludes rows in the air: where the aircraft was a moment ago still counts.
TEST(PositionWatch, HoldsFixesAgainstTheLastOneBelievedWhenItBeginsAnew) {
  PositionWatch watch(on_the_globe(), {}, {}, {});
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(believes(watch, fix_at(0.1 * i, 0.3 * i)));
  watch.begin_anew({between(1, 2)});
  EXPECT_FALSE(believes(watch, fix_at(5.0, 400)));
  EXPECT_TRUE(believes(watch, fix_at(5.1, 15.3)));
  watch.begin_anew({between(0, 60)});
  EXPECT_FALSE(believes(watch, fix_at(5.2, 15.6)));
  EXPECT_TRUE(believes(watch, fix_at(61, 400))) << "of what was believed nothing is left";
}

TEST(PositionWatch, TellsEveryBelievedFixTenPosesAndFiveFixesASecond) {
  PositionWatch watch(on_the_globe(), {}, {}, {});
  std::vector<PositionEvent> all;
  for (int i = 0; i < 200; ++i)
    for (auto& event : watch.add(fix_at(0.05 * i, 0.1 * i))) all.push_back(std::move(event));
  EXPECT_EQ(count<FixBelieved>(all), 200u);
  EXPECT_EQ(count<PoseMoved>(all), 100u);
  EXPECT_EQ(count<FixShown>(all), 50u);
}

TEST(PositionWatch, TellsOneFixOnce) {
  PositionWatch watch(on_the_globe(), {}, {}, {});
  EXPECT_FALSE(watch.add(fix_at(0, 0)).empty());
  EXPECT_TRUE(watch.add(fix_at(0, 0)).empty());
}

TEST(PositionWatch, ShowsPosesInTheFrameOfTheEstimates) {
  PositionWatch watch(on_the_globe(), {}, {}, {});
  for (int i = 0; i < 20; ++i) watch.add(fix_at(0.1 * i, 0.3 * i));
  ASSERT_TRUE(watch.pose());
  EXPECT_NEAR(watch.pose()->enu_m.y(), 5.7, 0.01) << "north of its own first fix";
  EXPECT_NEAR(watch.pose()->speed_mps.value(), 3.0, 0.02);
  watch.share_origin(fix_at(0, -100).position);
  watch.add(fix_at(2, 6));
  EXPECT_NEAR(watch.pose()->enu_m.y(), 106, 0.15);
}

TEST(PositionWatch, TellsWhereTheTagIsOnlyWhenTheAttitudeIsKnown) {
  Mission mission;
  mission.frame = TrackFrame::local;
  mission.tags = {{NetworkId{0x6e01}, 0, {0, 0, -0.5}}};
  PositionWatch watch(mission, {}, {}, {});
  Fix fix;
  fix.frame = TrackFrame::local;
  fix.fix = FixClass::rtk_fixed;
  fix.time = UtcTime::from_seconds(1);
  fix.local_m = {1, 2, 3};
  watch.add(fix);
  ASSERT_TRUE(watch.pose());
  EXPECT_FALSE(watch.pose()->tag_enu_m);
  fix.time = UtcTime::from_seconds(2);
  fix.enu_from_body = Eigen::Quaterniond(0, 1, 0, 0);  // upside down: half a turn about the forward axis
  watch.add(fix);
  ASSERT_TRUE(watch.pose()->tag_enu_m);
  EXPECT_LT((*watch.pose()->tag_enu_m - Eigen::Vector3d(1, 2, 3.5)).norm(), 1e-9);
}

testing::MadeFlight globe() {
  testing::MadeFlight made;
  made.frame = TrackFrame::wgs84;
  return made;
}

class SpoiltPositions : public ::testing::TestWithParam<testing::SpoiltWay> {};

TEST_P(SpoiltPositions, EndWhereTheAircraftIs) {
  const auto flight = make_flight(globe());
  auto bad = flight.fixes;
  GetParam().spoil(bad);
  PositionWatch watch(flight.mission, {}, {}, {});
  for (const Fix& fix : bad) watch.add(fix);
  ASSERT_TRUE(watch.pose());
  EXPECT_LT(testing::apart_m(flight.fixes.front().position, watch.pose()->fix.position), 100);
}

INSTANTIATE_TEST_SUITE_P(Ways, SpoiltPositions, ::testing::ValuesIn(testing::spoilt_ways()),
                         [](const auto& made) { return made.param.name; });

TEST(PositionWatch, FollowsTheAircraftThoughTheBaseMoved) {
  auto flight = make_flight(globe());
  const std::size_t from = flight.fixes.size() * 6 / 10;
  for (std::size_t i = from; i < flight.fixes.size(); ++i) testing::move(flight.fixes[i], {3, 0, 0});
  PositionWatch watch(flight.mission, {}, {}, {});
  for (std::size_t i = 0; i < from + 20; ++i) watch.add(flight.fixes[i]);
  EXPECT_EQ(watch.pose()->time, flight.fixes[from + 19].time);
}

}  // namespace
}  // namespace anchord::position_watch_test
