#include "api/missions/joint_worker.hpp"

#include "api/kit/memory.hpp"
#include "core/localize/flight_solver.hpp"

namespace anchord::api {

JointWorker::JointWorker() : thread_("anchord-joint", [this] { loop(); }) {}
JointWorker::~JointWorker() { stop(); }

bool JointWorker::idle() const {
  const std::scoped_lock lock(mutex_);
  return !busy_ && !stopping_;
}

bool JointWorker::try_start(Task task) {
  {
    const std::scoped_lock lock(mutex_);
    if (busy_ || stopping_) return false;
    busy_ = true;
    next_ = std::move(task);
  }
  changed_.notify_all();
  return true;
}

void JointWorker::stop() {
  {
    const std::scoped_lock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void JointWorker::loop() {
  while (true) {
    give_back_memory();
    Task task;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return stopping_ || next_; });
      if (stopping_) return;
      task = std::move(*next_);
      next_.reset();
    }
    task.options.canceled = [this] {
      const std::scoped_lock lock(mutex_);
      return stopping_;
    };
    const auto ran = guarded("joint solution", [&] {
      const auto solution = solve_flight(task.flight, task.options);
      task.done(solution ? &solution.value() : nullptr);
    });
    if (!ran) (void)guarded("joint solution", [&] { task.done(nullptr); });
    const std::scoped_lock lock(mutex_);
    busy_ = false;
  }
}

}  // namespace anchord::api
