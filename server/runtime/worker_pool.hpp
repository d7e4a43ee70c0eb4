#pragma once

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/guard.hpp"
#include "core/ports/executor.hpp"

namespace anchord::server {

/// Threads that run handlers, over one asio::io_context: not asio::thread_pool, whose threads have neither
/// name, guard nor niceness. Bounded: a full queue is an answer (503), not a wait. Thread-safe.
class WorkerPool final : public Executor {
 public:
  /// `nice`: added to the niceness of its threads, so that heavy work takes only the time others leave.
  WorkerPool(std::string name, std::size_t threads, std::size_t queue_limit, int nice = 0);
  /// stop().
  ~WorkerPool() override;
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// False when the queue is full or the pool stops; the task is then not run. What a task throws ends it
  /// alone (guarded).
  [[nodiscard]] bool try_submit(Task task);
  void post(Task task) override;
  std::unique_ptr<Executor> strand() override;
  /// Refuses new tasks, runs those in the queue, joins. Idempotent; not from a task.
  void stop();
  std::size_t queued() const { return queued_; }

 private:
  class Strand;
  bool take_place(std::size_t limit);
  /// The task, behind the guard; it leaves its place in the queue when it begins.
  Task counted(Task task);

  const std::string name_;
  const std::size_t queue_limit_;
  std::atomic<std::size_t> queued_{0};
  std::atomic<bool> stopping_{false};
  boost::asio::io_context io_;
  std::optional<boost::asio::executor_work_guard<boost::asio::io_context::executor_type>> work_;
  std::vector<Thread> threads_;
};

}  // namespace anchord::server
