#include "drivers/device/supervisor.hpp"

#include <gtest/gtest.h>

namespace anchord::device::supervisor_test {
namespace {

constexpr std::int64_t k_ms = 1'000'000, k_s = 1'000'000'000;

struct Machine {
  Wanted happen(Happened what, std::int64_t at_ns, const std::string& reason = {},
                std::int64_t pause_ns = 0) {
    const auto step = advance(state, {what, at_ns, uniform, reason, pause_ns});
    state = step.next;
    return step.wanted;
  }
  Supervision state;
  double uniform{1.0};  ///< the whole wait
};

TEST(Supervisor, FindsOpensAndTalks) {
  Machine m;
  EXPECT_EQ(m.happen(Happened::appeared, 0), Wanted::open);
  EXPECT_EQ(m.state.phase, Phase::found);
  EXPECT_FALSE(deadline_ns(m.state)) << "opening has its own deadline";
  m.happen(Happened::opened, 10 * k_ms);
  EXPECT_EQ(m.state.phase, Phase::open);
  m.happen(Happened::heard, 20 * k_ms);
  EXPECT_EQ(m.state.phase, Phase::talking);
  EXPECT_TRUE(m.state.reason.empty());
}

TEST(Supervisor, IsSilentTwoSecondsAfterTheLastGoodFrameAndReopensAfterTen) {
  Machine m;
  m.happen(Happened::appeared, 0);
  m.happen(Happened::opened, 0);
  m.happen(Happened::heard, 5 * k_s);
  EXPECT_EQ(deadline_ns(m.state), 7 * k_s);
  m.happen(Happened::tick, 7 * k_s - 1);
  EXPECT_EQ(m.state.phase, Phase::talking);
  m.happen(Happened::tick, 7 * k_s);
  EXPECT_EQ(m.state.phase, Phase::silent);
  EXPECT_EQ(deadline_ns(m.state), 15 * k_s);
  m.happen(Happened::heard, 9 * k_s);
  EXPECT_EQ(m.state.phase, Phase::talking) << "it may come back by itself";
  m.happen(Happened::tick, 11 * k_s);
  EXPECT_EQ(m.happen(Happened::tick, 19 * k_s), Wanted::close);
  EXPECT_EQ(m.state.phase, Phase::lost);
}

TEST(Supervisor, WaitsLongerAfterEachFailureButNeverBeyondTheBound) {
  Machine m;
  std::int64_t now = 0;
  std::vector<std::int64_t> waits;
  EXPECT_EQ(m.happen(Happened::appeared, 0), Wanted::open);
  for (int i = 0; i < 6; ++i) {
    m.happen(Happened::closed, now, "refused");
    EXPECT_EQ(m.state.reason, "refused");
    waits.push_back(m.state.try_at_ns - now);
    EXPECT_EQ(m.happen(Happened::tick, m.state.try_at_ns - 1), Wanted::nothing);
    now = m.state.try_at_ns;
    EXPECT_EQ(m.happen(Happened::tick, now), Wanted::open);
  }
  EXPECT_EQ(waits, (std::vector<std::int64_t>{500 * k_ms, k_s, 2 * k_s, 4 * k_s, 4 * k_s, 4 * k_s}));
  m.happen(Happened::opened, now);
  m.happen(Happened::heard, now);
  m.happen(Happened::closed, now, "unplugged");
  EXPECT_EQ(m.state.try_at_ns - now, 500 * k_ms) << "a good frame forgives";
}

TEST(Supervisor, AnOpenThatNeverHearsAnythingIsStillAFailure) {
  Machine m;
  m.happen(Happened::appeared, 0);
  m.happen(Happened::closed, 0);
  m.happen(Happened::tick, m.state.try_at_ns);
  m.happen(Happened::opened, k_s);
  m.happen(Happened::closed, k_s, "the other side closed");
  EXPECT_EQ(m.state.try_at_ns - k_s, k_s);
}

TEST(Supervisor, JitterShortensTheWaitByAQuarterAtMost) {
  Machine m;
  m.uniform = 0;
  m.happen(Happened::appeared, 0);
  m.happen(Happened::closed, 0);
  EXPECT_EQ(m.state.try_at_ns, 375 * k_ms);
}

TEST(Supervisor, APlugThatComesIsTriedAtOnce) {
  Machine m;
  m.happen(Happened::appeared, 0);
  for (int i = 0; i < 5; ++i) {
    m.happen(Happened::closed, i, "no such device");
    m.happen(Happened::tick, m.state.try_at_ns);
  }
  m.happen(Happened::closed, 100 * k_s, "unplugged");
  EXPECT_EQ(m.happen(Happened::appeared, 100 * k_s + k_ms), Wanted::open);
}

TEST(Supervisor, APauseThatTheOtherSideAskedForIsKept) {
  Machine m;
  m.happen(Happened::appeared, 0);
  m.happen(Happened::closed, 0, "401", 10 * k_s);
  EXPECT_EQ(m.state.try_at_ns, 10 * k_s);
}

TEST(Supervisor, LateReportsOfADeadLinkChangeNothing) {
  Machine m;
  m.happen(Happened::appeared, 0);
  m.happen(Happened::closed, 0, "first");
  const auto before = m.state;
  EXPECT_EQ(m.happen(Happened::opened, 1), Wanted::nothing);
  EXPECT_EQ(m.happen(Happened::heard, 2), Wanted::nothing);
  EXPECT_EQ(m.happen(Happened::closed, 3, "again"), Wanted::nothing);
  EXPECT_EQ(m.state.phase, Phase::lost);
  EXPECT_EQ(m.state.reason, "first");
  EXPECT_EQ(m.state.try_at_ns, before.try_at_ns);
}

}  // namespace
}  // namespace anchord::device::supervisor_test
