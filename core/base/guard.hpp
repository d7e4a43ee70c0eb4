#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace anchord {

/// The door of exceptions. Every thread, timer task, posted handler and task of a pool runs behind guarded():
/// what it throws ends this run of this task and nothing else. It is told (log) and remembered (the alarm
/// server.task_failed); whoever called decides how to go on. Nothing else catches everything.
struct TaskFailure {
  std::string task;        ///< "heartbeat": few and fixed, they are kept
  std::string what;        ///< of the newest failure, UTF-8
  std::uint64_t count{1};  ///< since the start
  std::chrono::steady_clock::time_point newest{};
};

/// Whether the task came to its end, else what it threw, in words.
struct Ran {
  bool whole{true};
  std::string what{};
  explicit operator bool() const { return whole; }
};

/// Who tells of failures; set once, before the threads. Until then they go to stderr. Called from any thread,
/// for the first failure of a task, for one with new words, and once in ten seconds for the same again.
void on_task_failure(std::function<void(const TaskFailure&)> tell);
/// Tasks that failed not longer ago than `within`, by name. Thread-safe.
std::vector<TaskFailure> task_failures(std::chrono::seconds within);

/// Inside a handler of catch: takes note of the exception that is being handled.
Ran note_task_failure(std::string_view task) noexcept;

template <class Task>
Ran guarded(std::string_view name, Task&& task) noexcept {
  try {
    std::forward<Task>(task)();
    return {};
  } catch (...) {
    return note_task_failure(name);
  }
}

/// For completion handlers of coroutines: not whole when an exception ended it.
inline Ran guarded_end(std::string_view name, const std::exception_ptr& fault) noexcept {
  return fault ? guarded(name, [&fault] { std::rethrow_exception(fault); }) : Ran{};
}

/// Runs an event loop (asio::io_context) until it is stopped or out of work: a handler that throws ends
/// alone, the loop goes on with the next one.
template <class Loop>
void run_guarded(std::string_view name, Loop& loop) {
  while (!guarded(name, [&loop] { loop.run(); })) {
  }
}

/// std::thread behind the guard, with the name that debuggers and top show (its first 15 bytes). The layering
/// test refuses any other way to a thread. A thread whose work must not end guards each round of its loop.
class Thread {
 public:
  Thread() = default;
  template <class Work>
  Thread(std::string name, Work work)
      : thread_([name = std::move(name), work = std::move(work)]() mutable {
          begin(name);
          (void)guarded(name, work);
        }) {}

  bool joinable() const { return thread_.joinable(); }
  void join() { thread_.join(); }
  void detach() { thread_.detach(); }

 private:
  static void begin(const std::string& name);
  std::thread thread_;
};

}  // namespace anchord
