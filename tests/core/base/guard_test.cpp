#include "core/base/guard.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

#include "core/base/text.hpp"

namespace anchord::guard_test {
namespace {

using std::chrono::seconds;

/// Of this name; the book is one for the process.
std::vector<TaskFailure> failures_of(const std::string& task) {
  auto all = task_failures(seconds(60));
  std::erase_if(all, [&](const TaskFailure& f) { return f.task != task; });
  return all;
}

TEST(Guarded, TellsWhatAnyTaskThrewAndGoesOn) {
  std::vector<std::string> told;
  on_task_failure([&](const TaskFailure& f) { told.push_back(f.task + ": " + f.what); });
  EXPECT_TRUE(guarded("quiet", [] {}));
  const auto ran = guarded("loud", [] { throw std::runtime_error("bytes \xff\xfe inside"); });
  EXPECT_FALSE(ran);
  EXPECT_EQ(ran.what, "bytes \xef\xbf\xbd\xef\xbf\xbd inside");
  EXPECT_FALSE(guarded("odd", [] { throw 7; }));  // no std::exception
  on_task_failure({});
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(told[0], "loud: bytes \xef\xbf\xbd\xef\xbf\xbd inside");
  EXPECT_TRUE(told[1].starts_with("odd: "));
}

TEST(Guarded, TellsTheSameOnceButCountsEach) {
  int told = 0;
  on_task_failure([&](const TaskFailure&) { ++told; });
  for (int i = 0; i < 100; ++i) (void)guarded("beat", [] { throw std::runtime_error("again"); });
  (void)guarded("beat", [] { throw std::runtime_error("something new"); });
  on_task_failure({});
  EXPECT_EQ(told, 2);
  const auto failures = failures_of("beat");
  ASSERT_EQ(failures.size(), 1u);
  EXPECT_EQ(failures[0].task, "beat");
  EXPECT_EQ(failures[0].what, "something new");
  EXPECT_EQ(failures[0].count, 101u);
  EXPECT_TRUE(task_failures(seconds(-1)).empty());
}

TEST(Guarded, SurvivesATellerThatThrows) {
  on_task_failure([](const TaskFailure&) { throw std::runtime_error("the disk of the log is full"); });
  EXPECT_FALSE(guarded("task", [] { throw std::runtime_error("first"); }));
  on_task_failure({});
}

TEST(GuardedThread, EndsAloneWhenItsWorkThrows) {
  on_task_failure([](const TaskFailure&) {});
  Thread thread("thrower", [] { throw std::runtime_error("out of here"); });
  thread.join();
  on_task_failure({});
  EXPECT_EQ(failures_of("thrower").size(), 1u);
}

TEST(GuardedLoop, GoesOnWithTheNextHandler) {
  on_task_failure([](const TaskFailure&) {});
  struct Loop {  // as io_context: what a handler throws leaves run(), and run() may be called again
    int left = 3, done = 0;
    void run() {
      while (left > 0) {
        --left;
        if (left == 1) throw std::runtime_error("one bad handler");
        ++done;
      }
    }
  } loop;
  run_guarded("loop", loop);
  on_task_failure({});
  EXPECT_EQ(loop.done, 2);
}

// A suite of its own, for the last of this file: it fills the book.
TEST(GuardedTasks, AreKeptUpToABoundedNumberOfNames) {
  on_task_failure([](const TaskFailure&) {});
  for (int i = 0; i < 1000; ++i) (void)guarded("task " + std::to_string(i), [] { throw 1; });
  on_task_failure({});
  EXPECT_LE(task_failures(seconds(60)).size(), 65u);
}

}  // namespace
}  // namespace anchord::guard_test
