// Two autopilots under one system id are known by what one alone cannot do, and one alone never is.
#include "drivers/drone/twin_watch.hpp"

#include <gtest/gtest.h>

namespace anchord::drone::twin_watch_test {
namespace {

const Wgs84 k_here{51.0231, 3.7131, 20}, k_there{51.0300, 3.7200, 20};

TEST(TwinWatch, TimeSinceBootThatGoesBackAgainAndAgainIsTwo) {
  TwinWatch watch;
  int n = 0;
  for (double now = 0; now < 4 && !watch.two(now); now += 0.5, ++n)
    watch.position(now, n % 2 == 0 ? 90'000 + n * 500 : 5'000'000 + n * 500, k_here);
  EXPECT_TRUE(watch.two(4));
  EXPECT_FALSE(watch.two(14)) << "one of them is off";
}

TEST(TwinWatch, OneThatRestartsIsNotTwo) {
  TwinWatch watch;
  double now = 0;
  for (const int life_s : {600, 20, 300}) {  // a battery swap, and another
    for (int ms = 0; ms < life_s * 1000; ms += 500, now += 0.5) {
      watch.position(now, ms, k_here);
      watch.heartbeat(now, false);
      ASSERT_FALSE(watch.two(now)) << life_s << " s, " << ms << " ms";
    }
  }
}

TEST(TwinWatch, FramesOutOfOrderAreNotTwo) {
  TwinWatch watch;
  for (int n = 0; n < 200; ++n) {
    const double now = 0.1 * n;
    watch.position(now, 100'000 + n * 100 - (n % 2) * 2'500, k_here);  // by two radios, one 2.5 s late
    EXPECT_FALSE(watch.two(now));
  }
}

TEST(TwinWatch, PlacesThatTakeTurnsAreTwoAndOneJumpIsNot) {
  TwinWatch twins, glitch;
  for (int n = 0; n < 8; ++n) {
    twins.position(0.2 * n, 1'000 + 200 * n, n % 2 == 0 ? k_here : k_there);
    glitch.position(0.2 * n, 1'000 + 200 * n, n == 4 ? k_there : k_here);
  }
  EXPECT_TRUE(twins.two(1.5));
  EXPECT_FALSE(glitch.two(1.5));
}

TEST(TwinWatch, ArmedAndNotArmedInTurnsIsTwoAndAPersonWhoTriesIsNot) {
  TwinWatch twins, person;
  for (int n = 0; n < 12; ++n) twins.heartbeat(0.5 * n, n % 2 == 0);
  EXPECT_TRUE(twins.two(6));
  for (int n = 0; n < 60; ++n) {
    person.heartbeat(0.5 * n, n / 6 % 2 == 0);  // arms, waits 3 s, disarms, and so on
    EXPECT_FALSE(person.two(0.5 * n));
  }
}

}  // namespace
}  // namespace anchord::drone::twin_watch_test
