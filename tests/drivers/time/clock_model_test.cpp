#include "drivers/time/clock_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace anchord::timing::clock_model_test {
namespace {

constexpr std::int64_t k_ms = 1'000'000, k_s = 1'000'000'000;

/// A device whose clock we know: device = (true - start) / (1 + drift).
struct Truth {
  std::int64_t start_ns{123'456'789'000};
  double drift{30e-6};
  std::int64_t device(std::int64_t steady_ns) const {
    return static_cast<std::int64_t>(std::llround(static_cast<double>(steady_ns - start_ns) / (1 + drift)));
  }
};

TEST(ClockModel, KnowsNothingBeforeTheFirstSample) {
  const ClockModel model;
  EXPECT_FALSE(model.steady_of(0));
  EXPECT_FALSE(model.device_of(0));
}

TEST(ClockModel, IsExactForALineWithoutNoise) {
  const Truth truth;
  ClockModel model;
  for (std::int64_t t = truth.start_ns; t < truth.start_ns + 60 * k_s; t += 100 * k_ms)
    model.add(truth.device(t), t);
  EXPECT_NEAR(model.drift(), truth.drift, 1e-9);  // rounding to a nanosecond over 60 s
  const auto at = truth.start_ns + 61 * k_s;
  EXPECT_NEAR(static_cast<double>(model.steady_of(truth.device(at))->ns - at), 0, 100);
  EXPECT_NEAR(static_cast<double>(model.device_of(at)->ns - truth.device(at)), 0, 100);
  EXPECT_TRUE(model.settled());
  EXPECT_EQ(model.jumps(), 0U);
}

/// Serial links through USB: 1 ms of frames, exponential waits, now and then a stall of the host.
struct Run {
  double worst_ms{0}, mean_ms{0}, sigma_ms{0}, drift_error_ppm{0};
  std::uint64_t jumps{0};
};
Run simulate(unsigned seed, double scale_ms, double stall_share, double drift) {
  std::mt19937_64 random(seed);
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
  Truth truth;
  truth.drift = drift;
  ClockModel model;
  Run run;
  int n = 0;
  for (std::int64_t t = truth.start_ns; t < truth.start_ns + 180 * k_s; t += 50 * k_ms) {
    double delay_ms = -scale_ms * std::log(1 - uniform());
    if (uniform() < stall_share) delay_ms += 2000 * uniform();
    model.add(truth.device(t), t + static_cast<std::int64_t>(delay_ms * 1e6));
    if (t < truth.start_ns + 30 * k_s) continue;
    const auto stamp = model.steady_of(truth.device(t));
    const double error_ms = static_cast<double>(stamp->ns - t) * 1e-6;
    run.worst_ms = std::max(run.worst_ms, std::abs(error_ms));
    run.mean_ms += error_ms;
    run.sigma_ms = stamp->sigma_ns * 1e-6;
    ++n;
  }
  run.mean_ms /= n;
  run.drift_error_ppm = (model.drift() - drift) * 1e6;
  run.jumps = model.jumps();
  return run;
}

TEST(ClockModel, FollowsTheLeastDelayUnderOneSidedJitter) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto run = simulate(seed, 5.0, 0.0, 40e-6);
    EXPECT_LT(run.worst_ms, 1.0) << seed;  // the mean delay is 5 ms: the envelope is what is followed
    EXPECT_LT(std::abs(run.drift_error_ppm), 15) << seed;
    EXPECT_EQ(run.jumps, 0U);
  }
}

TEST(ClockModel, IsNotMovedByStallsOfTheHost) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto run = simulate(seed, 2.0, 0.2, -25e-6);
    EXPECT_LT(run.worst_ms, 1.0) << seed;
    EXPECT_EQ(run.jumps, 0U) << seed;
  }
}

TEST(ClockModel, StatesAnUncertaintyThatItKeeps) {
  int outside = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto run = simulate(seed, 5.0, 0.05, 10e-6);
    if (std::abs(run.mean_ms) > 2 * run.sigma_ms) ++outside;
    EXPECT_LT(run.sigma_ms, 2.0);
  }
  EXPECT_LE(outside, 2);
}

TEST(ClockModel, StartsAnewWhenTheDeviceReboots) {
  ClockModel model;
  for (int i = 0; i < 300; ++i) model.add(i * 100 * k_ms, 5 * k_s + i * 100 * k_ms);
  EXPECT_EQ(model.jumps(), 0U);
  const auto reboot = 5 * k_s + 300 * 100 * k_ms;
  for (int i = 0; i < 20; ++i) model.add(i * 100 * k_ms, reboot + 2 * k_s + i * 100 * k_ms);
  EXPECT_EQ(model.jumps(), 1U);
  EXPECT_NEAR(static_cast<double>(model.steady_of(k_s)->ns), static_cast<double>(reboot + 3 * k_s), 1e6);
}

TEST(ClockModel, StartsAnewWhenTheDeviceClockLeapsAhead) {
  ClockModel model;
  for (int i = 0; i < 300; ++i) model.add(i * 100 * k_ms, 5 * k_s + i * 100 * k_ms);
  for (int i = 300; i < 340; ++i) model.add(i * 100 * k_ms + 10 * k_s, 5 * k_s + i * 100 * k_ms);
  EXPECT_EQ(model.jumps(), 1U);
  EXPECT_NEAR(static_cast<double>(model.steady_of(339 * 100 * k_ms + 10 * k_s)->ns),
              static_cast<double>(5 * k_s + 339 * 100 * k_ms), 1e6);
}

TEST(ClockModel, IgnoresOneDamagedTime) {
  ClockModel model;
  for (int i = 0; i < 300; ++i) {
    model.add(i * 100 * k_ms + (i == 150 ? 3600 * k_s : 0), 5 * k_s + i * 100 * k_ms);
  }
  EXPECT_EQ(model.jumps(), 0U);
  EXPECT_NEAR(static_cast<double>(model.steady_of(30 * k_s)->ns), static_cast<double>(35 * k_s), 1e6);
}

/// Nothing guards the numbers on a tag's wire: one bit of a counter of milliseconds, from 1 ms to 24 days.
TEST(ClockModel, StampsNothingByATimeWithABitThatIsWrong) {
  const Truth truth;
  for (int bit = 0; bit < 31; ++bit) {
    ClockModel model;
    for (std::int64_t t = truth.start_ns; t < truth.start_ns + 30 * k_s; t += 100 * k_ms) {
      const bool damaged = t > truth.start_ns + 12 * k_s && (t / (100 * k_ms)) % 12 == 0;
      const auto device_ns = truth.device(t) / k_ms * k_ms;
      const auto said_ns = damaged ? (device_ns / k_ms ^ (std::int64_t{1} << bit)) * k_ms : device_ns;
      const auto stamp = model.stamp(said_ns, t);
      if (!damaged) {
        // What is early by less than `early_ns` a clock may be: it moves the line by as much.
        const double near_ns = bit < 6 ? 50e6 : 2e6;
        ASSERT_TRUE(stamp) << bit;
        EXPECT_NEAR(static_cast<double>(stamp->ns - t), 0, near_ns) << bit;
      } else if (stamp) {  // as a link that stalls
        EXPECT_LT(stamp->ns, t + 51 * k_ms) << bit;
        EXPECT_GT(stamp->ns, t - 5 * k_s) << bit;
      }
    }
  }
}

TEST(ClockModel, ReportsAClockThatIsNone) {
  Truth bad;
  bad.drift = 5e-4;
  ClockModel model;
  for (std::int64_t t = bad.start_ns; t < bad.start_ns + 30 * k_s; t += 100 * k_ms)
    model.add(bad.device(t), t);
  EXPECT_TRUE(model.drift_too_large());
}

TEST(Unwrap, CountsOnPastTheWrapAndBearsSmallStepsBack) {
  Unwrap unwrap(32);
  EXPECT_EQ(unwrap(0xFFFF'FFF0U), 0xFFFF'FFF0);
  EXPECT_EQ(unwrap(0x10U), 0x1'0000'0010);
  EXPECT_EQ(unwrap(0x08U), 0x1'0000'0008);
  EXPECT_EQ(unwrap(0xFFFF'FFFFU), 0xFFFF'FFFF);
}

}  // namespace
}  // namespace anchord::timing::clock_model_test
