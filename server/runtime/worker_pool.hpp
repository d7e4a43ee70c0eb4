#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/guard.hpp"

namespace anchord::server {

/// Threads that run handlers. Bounded: a full queue is an answer (503), not a wait. Thread-safe.
class WorkerPool {
 public:
  /// `nice`: added to the niceness of its threads, so that heavy work takes only the time others leave.
  WorkerPool(std::string name, std::size_t threads, std::size_t queue_limit, int nice = 0);
  /// stop().
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// False when the queue is full or the pool stops; the task is then not run. What a task throws ends it
  /// alone (guarded).
  [[nodiscard]] bool try_submit(std::function<void()> task);
  /// Refuses new tasks, runs those in the queue, joins. Idempotent; not from a task.
  void stop();
  std::size_t queued() const;

 private:
  void run();
  const std::string name_;
  const std::size_t queue_limit_;
  mutable std::mutex mutex_;
  std::condition_variable work_;
  std::deque<std::function<void()>> queue_;
  bool stopping_{false};
  std::vector<Thread> threads_;
};

}  // namespace anchord::server
