#include "core/base/guard.hpp"

#include <pthread.h>

#include <cstdio>
#include <exception>
#include <map>

#include "core/base/locked.hpp"
#include "core/base/text.hpp"

namespace anchord {
namespace {

using MonotonicClock = std::chrono::steady_clock;

constexpr auto k_same_again = std::chrono::seconds(10);
constexpr std::size_t k_most_tasks = 64, k_most_words = 1000;

struct Kept {
  TaskFailure failure;
  MonotonicClock::time_point told{};
};

struct Book {
  std::map<std::string, Kept, std::less<>> tasks;
  std::function<void(const TaskFailure&)> tell;
};

/// Never destroyed: a thread may outlive main's statics.
Locked<Book>& book() {
  static auto* const one = new Locked<Book>;
  return *one;
}

std::string words_of_current() {
  try {
    throw;
  } catch (const std::exception& error) {
    return to_utf8(error.what(), k_most_words);
  } catch (...) {
    return "an exception that is not a std::exception";
  }
}

void report_stderr(const TaskFailure& failure) {
  std::fprintf(stderr, "anchord: %s failed: %s\n", failure.task.c_str(), printable(failure.what).c_str());
}

/// The failure if it is to be told now.
bool enter(std::string_view task, const std::string& what, TaskFailure& out,
           std::function<void(const TaskFailure&)>& tell) {
  const auto now = MonotonicClock::now();
  auto all = book().lock();
  auto found = all->tasks.find(task);
  if (found == all->tasks.end() && all->tasks.size() >= k_most_tasks) task = "another task";
  if (found == all->tasks.end()) found = all->tasks.try_emplace(to_utf8(task)).first;
  auto& [failure, told] = found->second;
  const bool news = failure.what != what || now - told >= k_same_again;
  const auto count = failure.newest == MonotonicClock::time_point{} ? 1 : failure.count + 1;
  failure = {found->first, what, count, now};
  if (news) told = now;
  out = failure;
  tell = all->tell;
  return news;
}

}  // namespace

void on_task_failure(std::function<void(const TaskFailure&)> tell) {
  auto all = book().lock();
  all->tell.swap(tell);
}

std::vector<TaskFailure> task_failures(std::chrono::seconds within) {
  std::vector<TaskFailure> out;
  const auto now = MonotonicClock::now();
  const auto all = book().lock();
  for (const auto& [name, kept] : all->tasks) {
    if (now - kept.failure.newest <= within) out.push_back(kept.failure);
  }
  return out;
}

Ran note_task_failure(std::string_view task) noexcept {
  Ran out{false, {}};
  try {
    out.what = words_of_current();
    TaskFailure failure;
    std::function<void(const TaskFailure&)> tell;
    if (enter(task, out.what, failure, tell)) tell ? tell(failure) : report_stderr(failure);
  } catch (...) {
    // No memory to tell of it, or the log itself throws: stderr takes constant bytes.
    std::fputs("anchord: a task failed, and so did logging it\n", stderr);
  }
  return out;
}

void Thread::begin(const std::string& name) { pthread_setname_np(pthread_self(), to_utf8(name, 15).c_str()); }

}  // namespace anchord
