#include "drivers/time/time_base.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <string>
#include <vector>

namespace anchord::timing::time_base_test {
namespace {

constexpr std::int64_t k_second_ns = 1'000'000'000;
constexpr std::int64_t k_epoch = 1'780'000'000 * k_second_ns;

link::Arrival at(std::int64_t steady_ns, std::int64_t system_off_ns = 0) {
  return {UtcTime{k_epoch + steady_ns + system_off_ns}, steady_ns};
}

TEST(TimeBase, StepsOfTheSystemClockMoveNothing) {
  TimeBase base;
  base.arrived(at(10 * k_second_ns));
  const auto before = base.utc_of(20 * k_second_ns);
  base.arrived(at(11 * k_second_ns, -7200 * k_second_ns));
  base.arrived(at(12 * k_second_ns, 3600 * k_second_ns));
  EXPECT_EQ(base.utc_of(20 * k_second_ns).time, before.time);
  EXPECT_EQ(before.time.ns, k_epoch + 20 * k_second_ns);
  ASSERT_TRUE(base.skew());
  EXPECT_NE(base.skew()->find("ahead by more than 2000 s"), std::string::npos) << *base.skew();
}

TEST(TimeBase, TakesUtcFromTheReceiverOnceItIsSettled) {
  TimeBase base;
  const std::int64_t wrong = 5 * k_second_ns;  // the system clock is five seconds ahead
  for (int i = 0; i < 15; ++i) {
    const auto steady = (100 + i) * k_second_ns;
    // measured 80 ms before it arrives, and the operator said so
    base.receiver_said(1, UtcTime{k_epoch + steady - 80'000'000}, at(steady, wrong), 0.08);
  }
  ASSERT_EQ(base.source(), TimeSource::receiver);
  const auto stamp = base.utc_of(130 * k_second_ns);
  EXPECT_NEAR(static_cast<double>(stamp.time.ns - (k_epoch + 130 * k_second_ns)), 0, 1e5);
  EXPECT_GE(stamp.sigma_s, TimeBase::k_latency_sigma_s);
  EXPECT_LT(stamp.sigma_s, 0.03);
  EXPECT_NEAR(base.system_offset_s().value(), 5.0, 1e-3);
  ASSERT_TRUE(base.skew());
  EXPECT_NE(base.skew()->find("ahead"), std::string::npos);
}

TEST(TimeBase, NamesTheSameSkewInTheSameWordsUntilItIsAnother) {
  TimeBase base;
  const auto skew_at = [&](std::int64_t system_off_ns) {
    for (int i = 0; i < 15; ++i) {
      const auto steady = (100 + i) * k_second_ns;
      base.receiver_said(1, UtcTime{k_epoch + steady}, at(steady, system_off_ns), 0);
    }
    return base.skew().value_or("");
  };
  EXPECT_EQ(
      skew_at(-300'000'000),
      "the system clock is more than 0.2 s behind the receiver's UTC: set the clock of this computer (NTP)");
  EXPECT_EQ(skew_at(-301'000'000), skew_at(-400'000'000)) << "an acknowledged alarm stays acknowledged";
  EXPECT_NE(skew_at(-301'000'000), skew_at(-600'000'000));
  EXPECT_EQ(skew_at(0), "");
  EXPECT_NE(skew_at(600'000'000)
                .find("(NTP); where that is right, the receiver's link takes so long: give its latency_ms"),
            std::string::npos)
      << skew_at(600'000'000);
}

TEST(TimeBase, IsQuietWhileTheSystemClockIsRight) {
  TimeBase base;
  for (int i = 0; i < 15; ++i) {
    const auto steady = (100 + i) * k_second_ns;
    base.receiver_said(1, UtcTime{k_epoch + steady - 60'000'000}, at(steady), 0.05);
  }
  EXPECT_FALSE(base.skew());
}

TEST(TimeBase, ASecondReceiverDoesNotDisturbTheFirst) {
  TimeBase base;
  for (int i = 0; i < 15; ++i) {
    const auto steady = (100 + i) * k_second_ns;
    base.receiver_said(1, UtcTime{k_epoch + steady}, at(steady), 0);
    base.receiver_said(2, UtcTime{k_epoch + steady + 999 * k_second_ns}, at(steady), 0);
  }
  EXPECT_NEAR(static_cast<double>(base.utc_of(120 * k_second_ns).time.ns - (k_epoch + 120 * k_second_ns)), 0,
              1e5);
}

/// A receiver of which the date was wrong was taken away, and its successor never followed: every range of
/// the flights of that day was stamped by it. A rover whose settings are changed is another one too.
TEST(TimeBase, AnotherReceiverTakesOverOnceTheFirstWasRemoved) {
  TimeBase base;
  const std::int64_t wrong = 100LL * 86'400 * k_second_ns;
  for (int i = 0; i < 15; ++i)
    base.receiver_said(1, UtcTime{k_epoch + (100 + i) * k_second_ns - wrong}, at((100 + i) * k_second_ns), 0);
  ASSERT_EQ(base.source(), TimeSource::receiver);
  base.receiver_gone(1);
  EXPECT_EQ(base.utc_of(116 * k_second_ns).time.ns, k_epoch + 116 * k_second_ns - wrong)
      << "there is no other yet";
  for (int i = 20; i < 35; ++i)
    base.receiver_said(2, UtcTime{k_epoch + (100 + i) * k_second_ns}, at((100 + i) * k_second_ns), 0);
  EXPECT_NEAR(static_cast<double>(base.utc_of(136 * k_second_ns).time.ns - (k_epoch + 136 * k_second_ns)), 0,
              1e5);
  EXPECT_FALSE(base.skew());
}

TEST(TimeBase, AnotherReceiverTakesOverFromOneThatFellSilentForHalfAMinuteAndNotFromOneThatComesBack) {
  const std::int64_t off = 999 * k_second_ns;
  const auto after_silence_of = [&](int silence_s, bool comes_back) {
    TimeBase base;
    for (int i = 0; i < 15; ++i)
      base.receiver_said(1, UtcTime{k_epoch + (100 + i) * k_second_ns}, at((100 + i) * k_second_ns), 0);
    for (int i = 15; i < 15 + silence_s; ++i)
      base.receiver_said(2, UtcTime{k_epoch + (100 + i) * k_second_ns + off}, at((100 + i) * k_second_ns), 0);
    for (int i = 15 + silence_s; comes_back && i < 30 + silence_s; ++i) {
      base.receiver_said(1, UtcTime{k_epoch + (100 + i) * k_second_ns}, at((100 + i) * k_second_ns), 0);
      base.receiver_said(2, UtcTime{k_epoch + (100 + i) * k_second_ns + off}, at((100 + i) * k_second_ns), 0);
    }
    return (base.utc_of(200 * k_second_ns).time.ns - (k_epoch + 200 * k_second_ns) + k_second_ns / 2) /
           k_second_ns;
  };
  EXPECT_EQ(after_silence_of(25, false), 0) << "a link that was lost for a while";
  EXPECT_EQ(after_silence_of(45, false), 999);
  EXPECT_EQ(after_silence_of(35, true), 0) << "it came back before the other's ten seconds were heard";
}

constexpr std::int64_t k_day_ns = 86'400 * k_second_ns;
constexpr std::int64_t k_1024_weeks_ns = 1024 * 7 * k_day_ns;

/// Receivers 1, 2, ... speak for 15 s, each its days off, beside a system clock that is off too.
struct Day {
  explicit Day(std::vector<std::int64_t> receivers_off_ns, std::int64_t system_off_ns = 0) {
    for (int i = 0; i < 15; ++i) {
      const auto steady = (100 + i) * k_second_ns;
      for (std::size_t r = 0; r < receivers_off_ns.size(); ++r)
        belief[static_cast<int>(r) + 1] =
            base.receiver_said(static_cast<int>(r) + 1, UtcTime{k_epoch + steady + receivers_off_ns[r]},
                               at(steady, system_off_ns), 0);
    }
  }
  std::int64_t off_ns() const {
    const auto off = base.utc_of(120 * k_second_ns).time.ns - (k_epoch + 120 * k_second_ns);
    return std::abs(off) < k_second_ns / 100 ? 0 : off;
  }
  std::string skew() const {
    return base.skew([](int id) { return std::string(1, static_cast<char>('a' + id - 1)); }).value_or("");
  }
  TimeBase base;
  std::map<int, Belief> belief;
};

// k_epoch is 2026-05-28; 1024 weeks are 19.6 years.
TEST(TimeBase, AGpsWeekRolloverIsNoTimeAndIsCalledByItsName) {
  const Day alone({-k_1024_weeks_ns});
  EXPECT_EQ(alone.belief.at(1), Belief::impossible);
  EXPECT_EQ(alone.base.source(), TimeSource::system_clock);
  EXPECT_EQ(alone.off_ns(), 0);
  EXPECT_EQ(alone.skew(),
            "device \"a\": the receiver says 2006-10-12, 1024 weeks early (GPS week rollover); its positions "
            "and its time are not used. Update its firmware, or use another one");
  const Day ahead({k_1024_weeks_ns});
  EXPECT_NE(ahead.skew().find("2046-01-11, 1024 weeks late"), std::string::npos) << ahead.skew();
}

TEST(TimeBase, AReceiverBesideOneWithARolloverGivesTheTime) {
  const Day day({-k_1024_weeks_ns, 0});
  EXPECT_EQ(day.belief.at(2), Belief::believed);
  EXPECT_EQ(day.base.source(), TimeSource::receiver);
  EXPECT_EQ(day.off_ns(), 0);
  EXPECT_NE(day.skew().find("device \"a\": the receiver says 2006-10-12"), std::string::npos) << day.skew();
  EXPECT_NE(day.skew().find("(device \"b\" says 2026-05-28)"), std::string::npos) << day.skew();
  // And where the system clock has lost its date, so that one receiver alone tells which rollover it is.
  const Day lost({-k_1024_weeks_ns, 0}, -k_epoch);
  EXPECT_EQ(lost.off_ns(), 0);
  EXPECT_NE(lost.skew().find("1024 weeks early"), std::string::npos) << lost.skew();
}

TEST(TimeBase, AReceiverWithAFixIsRightWhereTheSystemClockIsYearsBehind) {
  for (const std::int64_t system_off_ns : {-k_epoch, -700 * k_day_ns, -k_1024_weeks_ns}) {
    const Day day({0}, system_off_ns);
    EXPECT_EQ(day.belief.at(1), Belief::believed);
    EXPECT_EQ(day.base.source(), TimeSource::receiver);
    EXPECT_EQ(day.off_ns(), 0);
    EXPECT_NE(
        day.skew().find("the UTC of device \"a\" 2026-05-28, which is used: set the clock of this computer"),
        std::string::npos)
        << day.skew();
  }
}

TEST(TimeBase, ADateThatIsNotYetOneAndASystemClockWithoutOneAreBothTold) {
  const std::int64_t y1980 = 315'964'842 * k_second_ns - k_epoch;
  const Day cold({y1980}, -k_epoch);
  EXPECT_EQ(cold.belief.at(1), Belief::impossible);
  EXPECT_EQ(cold.base.source(), TimeSource::system_clock);
  EXPECT_NE(cold.skew().find("the receiver says 1980-01-06, which cannot be"), std::string::npos)
      << cold.skew();
  TimeBase alone;
  alone.arrived(at(100 * k_second_ns, -k_epoch));
  EXPECT_EQ(
      alone.skew().value_or(""),
      "the system clock says 1970-01-01, which cannot be: set the clock of this computer (NTP), or connect "
      "a GNSS receiver");
}

TEST(TimeBase, OneReceiverAgainstAnotherAndTheSystemClockIsOutvotedWhicheverSpokeFirst) {
  const std::int64_t off = 400 * k_day_ns;
  for (const bool wrong_first : {false, true}) {
    const Day day(wrong_first ? std::vector{off, std::int64_t{0}} : std::vector{std::int64_t{0}, off});
    EXPECT_EQ(day.belief.at(wrong_first ? 1 : 2), Belief::outvoted);
    EXPECT_EQ(day.off_ns(), 0);
    EXPECT_NE(day.skew().find("2027-07-02"), std::string::npos) << day.skew();
    EXPECT_NE(day.skew().find("2026-05-28"), std::string::npos) << day.skew();
    EXPECT_TRUE(day.skew().find("\"a\"") != std::string::npos &&
                day.skew().find("\"b\"") != std::string::npos)
        << day.skew();
  }
  const Day two_against_one({off, 0, 0}, -k_epoch);
  EXPECT_EQ(two_against_one.belief.at(1), Belief::outvoted);
  EXPECT_EQ(two_against_one.off_ns(), 0);
}

TEST(TimeBase, TwoReceiversThatDisagreeAreBothNamedInPlainNumbers) {
  const Day leap({0, 18 * k_second_ns});
  EXPECT_EQ(
      leap.skew(),
      "two receivers disagree: device \"b\" is more than 10 s ahead of device \"a\", whose time is used: "
      "find out which one is wrong and switch it off");
  EXPECT_EQ(Day({0, k_second_ns / 2}).skew(), "") << "a slow link";
  const Day lost({0, 900 * k_day_ns}, -k_epoch);
  EXPECT_EQ(
      lost.skew(),
      "two receivers disagree: device \"b\" says 2028-11-13, device \"a\" says 2026-05-28, whose time is "
      "used: find out which one is wrong and switch it off");
}

}  // namespace
}  // namespace anchord::timing::time_base_test
