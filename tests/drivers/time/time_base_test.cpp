#include "drivers/time/time_base.hpp"

#include <gtest/gtest.h>

namespace anchord::timing {
namespace {

constexpr std::int64_t k_s = 1'000'000'000;
constexpr std::int64_t k_epoch = 1'780'000'000 * k_s;

link::Arrival at(std::int64_t steady_ns, std::int64_t system_off_ns = 0) {
  return {UtcTime{k_epoch + steady_ns + system_off_ns}, steady_ns};
}

TEST(TimeBase, StepsOfTheSystemClockMoveNothing) {
  TimeBase base;
  base.arrived(at(10 * k_s));
  const auto before = base.utc_of(20 * k_s);
  base.arrived(at(11 * k_s, -7200 * k_s));
  base.arrived(at(12 * k_s, 3600 * k_s));
  EXPECT_EQ(base.utc_of(20 * k_s).time, before.time);
  EXPECT_EQ(before.time.ns, k_epoch + 20 * k_s);
  ASSERT_TRUE(base.skew());
  EXPECT_NE(base.skew()->find("ahead by more than 2000 s"), std::string::npos) << *base.skew();
}

TEST(TimeBase, TakesUtcFromTheReceiverOnceItIsSettled) {
  TimeBase base;
  const std::int64_t wrong = 5 * k_s;  // the system clock is five seconds ahead
  for (int i = 0; i < 15; ++i) {
    const auto steady = (100 + i) * k_s;
    // measured 80 ms before it arrives, and the operator said so
    base.receiver_said(1, UtcTime{k_epoch + steady - 80'000'000}, at(steady, wrong), 0.08);
  }
  ASSERT_EQ(base.source(), TimeSource::receiver);
  const auto stamp = base.utc_of(130 * k_s);
  EXPECT_NEAR(static_cast<double>(stamp.time.ns - (k_epoch + 130 * k_s)), 0, 1e5);
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
      const auto steady = (100 + i) * k_s;
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
    const auto steady = (100 + i) * k_s;
    base.receiver_said(1, UtcTime{k_epoch + steady - 60'000'000}, at(steady), 0.05);
  }
  EXPECT_FALSE(base.skew());
}

TEST(TimeBase, ASecondReceiverDoesNotDisturbTheFirst) {
  TimeBase base;
  for (int i = 0; i < 15; ++i) {
    const auto steady = (100 + i) * k_s;
    base.receiver_said(1, UtcTime{k_epoch + steady}, at(steady), 0);
    base.receiver_said(2, UtcTime{k_epoch + steady + 999 * k_s}, at(steady), 0);
  }
  EXPECT_NEAR(static_cast<double>(base.utc_of(120 * k_s).time.ns - (k_epoch + 120 * k_s)), 0, 1e5);
}

}  // namespace
}  // namespace anchord::timing
