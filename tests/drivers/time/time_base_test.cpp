#include "drivers/time/time_base.hpp"

#include <gtest/gtest.h>

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
  EXPECT_EQ(skew_at(-300'000'000), "the system clock is more than 0.2 s behind the receiver's UTC");
  EXPECT_EQ(skew_at(-301'000'000), skew_at(-400'000'000)) << "an acknowledged alarm stays acknowledged";
  EXPECT_NE(skew_at(-301'000'000), skew_at(-600'000'000));
  EXPECT_EQ(skew_at(0), "");
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

/// A receiver of which the week was wrong was taken away, and its successor never followed: every range of
/// the flights of that day was stamped 1024 weeks early. A rover whose settings are changed is another one
/// too.
TEST(TimeBase, AnotherReceiverTakesOverOnceTheFirstWasRemoved) {
  TimeBase base;
  const std::int64_t wrong = 1024LL * 7 * 86'400 * k_second_ns;
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

}  // namespace
}  // namespace anchord::timing::time_base_test
