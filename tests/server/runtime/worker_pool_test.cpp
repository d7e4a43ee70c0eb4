// Executors over threads: bounded, in order where a strand is asked for, and nothing that was taken is lost.
#include "server/runtime/worker_pool.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <thread>
#include <vector>

namespace anchord::server::worker_pool_test {
namespace {

/// Holds one thread of a pool until it is let go.
class Plug {
 public:
  explicit Plug(WorkerPool& pool) {
    pool.post([this] {
      entered_.set_value();
      let_go_.get_future().wait();
    });
    entered_.get_future().wait();
  }
  void let_go() { let_go_.set_value(); }

 private:
  std::promise<void> entered_, let_go_;
};

TEST(WorkerPool, RefusesWhatItsQueueHasNoPlaceFor) {
  WorkerPool pool("test", 1, 2);
  Plug plug(pool);
  std::atomic<int> ran{0};
  EXPECT_TRUE(pool.try_submit([&] { ++ran; }));
  EXPECT_TRUE(pool.try_submit([&] { ++ran; }));
  EXPECT_FALSE(pool.try_submit([&] { ++ran; }));
  EXPECT_EQ(pool.queued(), 2U);
  plug.let_go();
  pool.stop();
  EXPECT_EQ(ran, 2);
}

TEST(WorkerPool, WhatIsPostedToAFullOneSlowsItsSenderAndIsNotLost) {
  WorkerPool pool("test", 1, 1);
  Plug plug(pool);
  std::vector<std::thread::id> by;
  pool.post([&] { by.push_back(std::this_thread::get_id()); });
  std::thread::id second;
  pool.post([&] { second = std::this_thread::get_id(); });
  EXPECT_EQ(second, std::this_thread::get_id());
  plug.let_go();
  pool.stop();
  ASSERT_EQ(by.size(), 1U);
  EXPECT_NE(by.front(), std::this_thread::get_id());
}

TEST(WorkerPool, AStrandRunsItsTasksInOrderAndNeverTwoAtOnce) {
  WorkerPool pool("test", 4, 4);
  const auto strand = pool.strand();
  std::atomic<int> inside{0}, together{0};
  std::vector<int> order;
  constexpr int k_tasks = 10'000;
  for (int i = 0; i < k_tasks; ++i) {
    strand->post([&, i] {
      if (++inside > 1) ++together;
      order.push_back(i);
      --inside;
    });
  }
  pool.stop();
  EXPECT_EQ(together, 0);
  ASSERT_EQ(order.size(), static_cast<std::size_t>(k_tasks));
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
}

TEST(WorkerPool, EveryTaskRunsOnceHoweverItStops) {
  for (int round = 0; round < 200; ++round) {
    std::atomic<int> ran{0};
    int posted = 0;
    WorkerPool pool("test", 2, 8);
    const auto strand = pool.strand();
    std::atomic<bool> going{true};
    Thread sender("sender", [&] {
      while (going) {
        pool.post([&] { ++ran; });
        strand->post([&] { ++ran; });
        posted += 2;
      }
    });
    std::this_thread::yield();
    pool.stop();
    going = false;
    sender.join();
    pool.stop();
    EXPECT_EQ(ran, posted) << "round " << round;
  }
}

TEST(WorkerPool, WhatATaskThrowsEndsThatTaskAlone) {
  WorkerPool pool("test", 1, 4);
  std::atomic<int> ran{0};
  pool.post([] { throw std::runtime_error("a task of the test"); });
  pool.post([&] { ++ran; });
  pool.stop();
  EXPECT_EQ(ran, 1);
}

}  // namespace
}  // namespace anchord::server::worker_pool_test
