#pragma once

#include <functional>
#include <memory>

namespace anchord {

/// Where tasks run that their sender does not wait for. Whoever makes one decides on which threads, how many
/// may wait, and what runs beside; what a task throws ends that task alone. Thread-safe.
class Executor {
 public:
  using Task = std::function<void()>;
  virtual ~Executor() = default;
  /// Every task runs, once. One that is full or stopped runs it at once on the caller's thread, so that a
  /// sender who is too quick is slowed and nothing is lost: post with no lock held that the task takes.
  virtual void post(Task task) = 0;
  /// The same threads, but its tasks run one after the other in the order in which they were posted. Ends
  /// before the executor that it is of; tasks that wait then still run.
  virtual std::unique_ptr<Executor> strand() = 0;
};

/// No threads: every task runs at once, where it is posted (tests, a recording read back).
class InlineExecutor final : public Executor {
 public:
  void post(Task task) override { task(); }
  std::unique_ptr<Executor> strand() override { return std::make_unique<InlineExecutor>(); }
};

}  // namespace anchord
