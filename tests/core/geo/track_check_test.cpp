#include "core/geo/track_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/geo/enu.hpp"

namespace anchord::track_check_test {
namespace {

constexpr Wgs84 k_home{51.0231, 3.7131, 55.5};

/// A flight of figures of eight at 2 to 5 m/s, ten fixes a second, 2 cm of noise.
std::vector<Fix> clean(double seconds = 60, double rate_hz = 10) {
  const EnuFrame frame(k_home);
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.02);
  std::vector<Fix> fixes;
  for (int i = 0; i < static_cast<int>(seconds * rate_hz); ++i) {
    const double t_s = i / rate_hz;
    Fix fix;
    fix.time = UtcTime::from_seconds(1'777'889'000 + t_s);
    fix.fix = FixClass::rtk_fixed;
    fix.position = frame.wgs84_from_enu(
        {{18 * std::sin(0.13 * t_s) + noise(random), 15 * std::cos(0.17 * t_s) + noise(random),
          6 + 5 * std::sin(0.29 * t_s) + noise(random)}});
    fixes.push_back(fix);
  }
  return fixes;
}

void move(Fix& fix, const Eigen::Vector3d& by_m) {
  const EnuFrame frame(k_home);
  fix.position = frame.wgs84_from_enu({frame.enu_from_wgs84(fix.position).m + by_m});
}

std::size_t n_of(const CheckedTrack& track, const std::string& word) {
  const auto at = track.refused.find(word);
  return at == track.refused.end() ? 0 : at->second;
}

CheckedTrack check(const std::vector<Fix>& fixes) {
  return check_track(fixes, TrackFrame::wgs84, FixClass::rtk_fixed);
}

double from_home_m(const CheckedTrack& track) {
  return EnuFrame(k_home).enu_from_wgs84(track.centre.value()).m.norm();
}

TEST(TrackCheck, KeepsEveryPositionOfACleanFlight) {
  for (const double rate_hz : {1.0, 5.0, 10.0, 100.0}) {
    const auto track = check(clean(60, rate_hz));
    EXPECT_TRUE(track.refused.empty()) << rate_hz << " Hz: " << track.notes.front();
    EXPECT_EQ(track.fixes.size(), static_cast<std::size_t>(60 * rate_hz));
  }
}

TEST(TrackCheck, OneWildFirstFixDecidesNeitherOriginNorTrack) {
  auto fixes = clean();
  move(fixes.front(), {33'000, 0, 0});
  const auto track = check(fixes);
  EXPECT_EQ(n_of(track, "position_jump"), 1U);
  EXPECT_EQ(track.fixes.size(), fixes.size() - 1);
  EXPECT_LT(from_home_m(track), 20);
}

TEST(TrackCheck, FindsIsolatedJumpsInEitherDirectionAndInHeightAlone) {
  auto fixes = clean();
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> size_m(1, 50), angle(0, 6.28);
  std::size_t n = 0;
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    if (i % 20 != 11 && i % 40 != 30) continue;
    const double a = angle(random), m = size_m(random);
    move(fixes[i], i % 2 == 0 ? Eigen::Vector3d(0, 0, i % 3 == 0 ? m : -m)
                              : Eigen::Vector3d(m * std::cos(a), m * std::sin(a), 0));
    ++n;
  }
  const auto track = check(fixes);
  EXPECT_EQ(n_of(track, "position_jump"), n);
  EXPECT_EQ(track.fixes.size(), fixes.size() - n);
}

TEST(TrackCheck, TakesTheMajorityWhereAWholePartIsOffAndSaysSo) {
  for (const auto& [from, to] : {std::pair{0, 20}, std::pair{400, 600}, std::pair{200, 300}}) {
    auto fixes = clean();
    for (int i = from; i < to; ++i) move(fixes[static_cast<std::size_t>(i)], {3, 0, 0});
    const auto track = check(fixes);
    const auto n = static_cast<std::size_t>(to - from);
    EXPECT_EQ(n_of(track, "position_step"), n) << from;
    EXPECT_EQ(track.fixes.size(), fixes.size() - n);
    EXPECT_NEAR(track.step_share, static_cast<double>(n) / 600.0, 1e-9);
    ASSERT_FALSE(track.notes.empty());
    EXPECT_NE(track.notes.front().find("base moved"), std::string::npos) << track.notes.front();
  }
}

TEST(TrackCheck, CountsRtkWithOldCorrectionsAsFloat) {
  auto fixes = clean();
  for (std::size_t i = 0; i < 100; ++i) fixes[i].correction_age_s = i < 50 ? 120.0 : 29.0;
  const auto track = check(fixes);
  EXPECT_EQ(n_of(track, "old_correction"), 50U);
  EXPECT_EQ(track.fixes.size(), fixes.size());
  EXPECT_EQ(track.fixes[10].fix, FixClass::rtk_float);
  EXPECT_EQ(track.fixes[60].fix, FixClass::rtk_fixed);
}

TEST(TrackCheck, RefusesStampsOfTomorrowOfAnHourAheadAndOfYesterday) {
  for (const auto& [by_s, word] : {std::pair{86'400.0, "future_stamp"}, std::pair{40.0, "future_stamp"},
                                   std::pair{-86'400.0, "out_of_order"}}) {
    auto fixes = clean();
    for (std::size_t i = 7; i < fixes.size() - 1; i += 20)
      fixes[i].time.ns += static_cast<std::int64_t>(by_s * 1e9);
    const auto track = check(fixes);
    EXPECT_EQ(n_of(track, word), 30U) << by_s;
    EXPECT_EQ(track.fixes.size(), fixes.size() - 30) << by_s;
  }
  // All of it in one go at the end, as a file sorted by time has it.
  auto fixes = clean();
  for (std::size_t i = 580; i < 600; ++i) fixes[i].time.ns += 86'400'000'000'000;
  EXPECT_EQ(n_of(check(fixes), "future_stamp"), 20U);
}

TEST(TrackCheck, TakesFixesInAnyOrderAndAcrossAPause) {
  auto fixes = clean();
  for (std::size_t i = 300; i < 600; ++i) fixes[i].time.ns += 1'200'000'000'000;
  EXPECT_TRUE(check(fixes).refused.empty());
  std::mt19937_64 random(1);
  std::ranges::shuffle(fixes, random);
  EXPECT_TRUE(check(fixes).refused.empty());
  std::ranges::reverse(fixes);
  EXPECT_TRUE(check(fixes).refused.empty());
}

TEST(TrackCheck, LesserFixesNeitherJudgeNorAreLost) {
  auto fixes = clean();
  for (std::size_t i = 100; i < 200; ++i) {
    fixes[i].fix = FixClass::rtk_float;
    move(fixes[i], {4, 0, 0});
  }
  move(fixes[150], {40'000, 0, 0});
  const auto track = check(fixes);
  EXPECT_EQ(n_of(track, "far_from_flight"), 1U);
  EXPECT_EQ(track.fixes.size(), 599U);
}

TEST(TrackCheck, SurvivesNothingOneAndRubbish) {
  EXPECT_TRUE(check({}).fixes.empty());
  auto one = clean(0.1);
  EXPECT_EQ(check(one).fixes.size(), 1U);
  one.front().position.lat_deg = std::nan("");
  EXPECT_EQ(n_of(check(one), "not_usable"), 1U);
  auto none = clean();
  for (auto& fix : none) fix.fix = FixClass::none;
  EXPECT_TRUE(check(none).fixes.empty());
}

}  // namespace
}  // namespace anchord::track_check_test
