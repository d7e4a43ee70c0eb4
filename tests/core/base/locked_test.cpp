#include "core/base/locked.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "core/base/guard.hpp"

namespace anchord::locked_test {
namespace {

using namespace std::chrono_literals;

constexpr auto k_deadline = 20s;

template <class T>
concept Arrow = requires(T guard) {
  std::forward<T>(guard).operator->();
};
template <class T>
concept Star = requires(T guard) {
  *std::forward<T>(guard);
};

using Words = Locked<std::vector<std::string>>;
static_assert(Arrow<Words::Exclusive&> && Star<Words::Exclusive&>);
static_assert(!Arrow<Words::Exclusive&&> && !Star<Words::Exclusive&&>,
              "the lock ends before what it gave is used");
static_assert(
    std::is_same_v<decltype(*std::declval<const Words::Reader&>()), const std::vector<std::string>&>);

struct Count {
  int n{0};
  bool over{false};
};

/// Whether another thread finds the lock free.
template <class T>
bool free_for_others(T& locked) {
  bool found = false;
  Thread other("other", [&] { found = static_cast<bool>(locked.try_lock()); });
  other.join();
  return found;
}

TEST(Locked, AddsUpWhatManyThreadsCount) {
  constexpr int k_threads = 4, k_rounds = 20'000;
  Locked<Count> count;
  std::vector<Thread> threads;
  for (int t = 0; t < k_threads; ++t) {
    threads.emplace_back("counter", [&] {
      for (int i = 0; i < k_rounds; ++i) {
        auto held = count.lock();
        ++held->n;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(count.copy().n, k_threads * k_rounds);
}

TEST(Locked, IsHeldAsLongAsItsGuardLives) {
  Locked<int> value(7);
  {
    const auto held = value.lock();
    EXPECT_EQ(*held, 7);
    EXPECT_FALSE(free_for_others(value));
  }
  EXPECT_TRUE(free_for_others(value));
}

TEST(Locked, GivesNothingWhereTryLockFailed) {
  Locked<int> value(7);
  const auto held = value.lock();
  bool refused = false;
  Thread other("other", [&] {
    const auto again = value.try_lock();
    EXPECT_FALSE(again);
    EXPECT_THROW((void)*again, std::logic_error);
    EXPECT_THROW((void)again.operator->(), std::logic_error);
    refused = true;
  });
  other.join();
  EXPECT_TRUE(refused);
}

TEST(Locked, IsFreeWhileUnlockedWorkRunsAndHeldAfterIt) {
  Locked<Count> count;
  auto held = count.lock();
  held->n = 1;
  const int got = held.unlocked([&] {
    EXPECT_TRUE(free_for_others(count));
    EXPECT_THROW((void)held->n, std::logic_error);
    return 5;
  });
  EXPECT_EQ(got, 5);
  EXPECT_EQ(held->n, 1);
  EXPECT_FALSE(free_for_others(count));
  EXPECT_THROW(held.unlocked([] { throw std::runtime_error("disk"); }), std::runtime_error);
  EXPECT_FALSE(free_for_others(count));
}

TEST(Locked, WaitsUntilAnotherThreadChangesTheValue) {
  Locked<Count> count;
  std::condition_variable changed;
  std::promise<void> waiting;
  Thread other("other", [&] {
    waiting.get_future().wait();
    auto held = count.lock();  // free only once the other waits
    held->over = true;
    held->n = 3;
    changed.notify_all();
  });
  {
    auto held = count.lock();
    waiting.set_value();
    held.wait(changed, [](const Count& c) { return c.over; });
    EXPECT_EQ(held->n, 3);
  }
  other.join();
  auto held = count.lock();
  EXPECT_TRUE(held.wait_for(changed, k_deadline, [](const Count& c) { return c.n == 3; }));
  EXPECT_TRUE(held.wait_until(changed, std::chrono::steady_clock::now() + k_deadline,
                              [](const Count& c) { return c.n == 3; }));
  EXPECT_FALSE(held.wait_for(changed, 1ms, [](const Count& c) { return c.n == 4; }));
  EXPECT_FALSE(held.wait_until(changed, std::chrono::steady_clock::now() + 1ms,
                               [](const Count& c) { return c.n == 4; }));
  EXPECT_FALSE(free_for_others(count));
}

TEST(Locked, LetsManyReadAndOneWrite) {
  Locked<int, std::shared_mutex> value(7);
  const auto& to_read = value;
  const auto first = to_read.lock_shared();
  std::promise<int> second;
  Thread other("other", [&] {
    const auto also = to_read.lock_shared();
    second.set_value(*also);
  });
  auto got = second.get_future();
  ASSERT_EQ(got.wait_for(k_deadline), std::future_status::ready);
  EXPECT_EQ(got.get(), 7);
  other.join();
  EXPECT_FALSE(free_for_others(value));
}

TEST(Locked, ExchangesAndLetsTheOldValueGoWithoutTheLock) {
  struct Watched {
    Locked<std::shared_ptr<Watched>>* of{};
    bool* free{};
    ~Watched() { *free = free_for_others(*of); }
  };
  bool was_free = false;
  Locked<std::shared_ptr<Watched>> value;
  (void)value.exchange(std::shared_ptr<Watched>(new Watched{&value, &was_free}));
  EXPECT_NE(value.copy(), nullptr);
  (void)value.exchange(nullptr);
  EXPECT_TRUE(was_free);
  EXPECT_EQ(value.copy(), nullptr);
}

TEST(Locked, BuildsItsValueInPlace) {
  struct Fixed {  // neither copied nor moved
    Fixed(int a, int b) : sum(a + b) {}
    Fixed(const Fixed&) = delete;
    int sum;
  };
  Locked<Fixed> value(std::in_place, 3, 4);
  const auto held = value.lock();
  EXPECT_EQ(held->sum, 7);
}

}  // namespace
}  // namespace anchord::locked_test
