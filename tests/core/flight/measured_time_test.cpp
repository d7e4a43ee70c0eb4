// When a row was measured, by the clock that a flight is flown by.
#include "core/flight/measured_time.hpp"

#include <gtest/gtest.h>

namespace anchord::measured_time_test {
namespace {

constexpr double k_rover_ahead_s = 1.7e9;  // its clock and ours have nothing to do with each other
constexpr double k_rounding_s = 1e-6;      // of a double that counts from 1970

double at(flight::MeasuredTime& time, double measured_s, double delay_s) {
  return time.at(UtcTime::from_seconds(k_rover_ahead_s + measured_s), measured_s + delay_s);
}

TEST(MeasuredTime, WhatComesAtOnceWasMeasuredNow) {
  flight::MeasuredTime time;
  for (int i = 0; i < 1000; ++i) EXPECT_NEAR(at(time, 0.1 * i, 0.03), 0.1 * i + 0.03, k_rounding_s);
}

TEST(MeasuredTime, WhatWaitedInAQueueIsOlderByAsMuch) {
  flight::MeasuredTime time;
  EXPECT_NEAR(at(time, 10, 0.03), 10.03, k_rounding_s);
  EXPECT_NEAR(at(time, 10.1, 4.03), 10.13, k_rounding_s);
  EXPECT_NEAR(at(time, 14.2, 0.03), 14.23, k_rounding_s);
}

TEST(MeasuredTime, AnotherDelayCountsAsNoneAfterHalfAMinute) {
  flight::MeasuredTime time;
  EXPECT_NEAR(at(time, 0, 0.03), 0.03, k_rounding_s);
  for (int s = 1; s < 30; ++s) EXPECT_NEAR(at(time, s, 1.03), s + 0.03, k_rounding_s) << s;
  for (int s = 30; s < 60; ++s) EXPECT_NEAR(at(time, s, 1.03), s + 1.03, k_rounding_s) << s;
}

TEST(MeasuredTime, AClockThatIsPutForwardIsFollowedAtOnceAndNothingIsMeasuredInTheFuture) {
  flight::MeasuredTime time;
  EXPECT_NEAR(at(time, 0, 0.5), 0.5, k_rounding_s);
  EXPECT_NEAR(time.at(UtcTime::from_seconds(k_rover_ahead_s + 60), 1.5), 1.5, k_rounding_s);
}

}  // namespace
}  // namespace anchord::measured_time_test
