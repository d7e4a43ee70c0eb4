#include "server/runtime/worker_pool.hpp"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <boost/asio/post.hpp>
#include <boost/asio/strand.hpp>
#include <thread>
#include <utility>

namespace anchord::server {

/// Those who use strands bound themselves what they post: its tasks count, but are not refused.
class WorkerPool::Strand final : public Executor {
 public:
  explicit Strand(WorkerPool& pool) : pool_(pool), strand_(boost::asio::make_strand(pool.io_)) {}
  void post(Task task) override {
    if (!pool_.take_place(~std::size_t{0})) return void(guarded(pool_.name_, task));
    boost::asio::post(strand_, pool_.counted(std::move(task)));
  }
  std::unique_ptr<Executor> strand() override { return pool_.strand(); }

 private:
  WorkerPool& pool_;
  boost::asio::strand<boost::asio::io_context::executor_type> strand_;
};

WorkerPool::WorkerPool(std::string name, std::size_t threads, std::size_t queue_limit, int nice)
    : name_(std::move(name)), queue_limit_(queue_limit), io_(static_cast<int>(threads)) {
  work_.emplace(io_.get_executor());
  threads_.reserve(threads);
  for (std::size_t i = 0; i < threads; ++i) {
    threads_.emplace_back(name_, [this, nice] {
      // On Linux niceness belongs to the thread. A system that refuses it only shares more evenly.
      if (nice != 0) (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), nice);
      run_guarded(name_, io_);
    });
  }
}

WorkerPool::~WorkerPool() { stop(); }

/// Counted before it is asked whether the pool stops: stop() then waits for it, or it sees that it stops.
bool WorkerPool::take_place(std::size_t limit) {
  if (queued_.fetch_add(1) < limit && !stopping_) return true;
  --queued_;
  return false;
}

Executor::Task WorkerPool::counted(Task task) {
  return [this, task = std::move(task)] {
    --queued_;
    (void)guarded(name_, task);
  };
}

bool WorkerPool::try_submit(Task task) {
  if (!take_place(queue_limit_)) return false;
  boost::asio::post(io_, counted(std::move(task)));
  return true;
}

void WorkerPool::post(Task task) {
  if (!take_place(queue_limit_)) return void(guarded(name_, task));
  boost::asio::post(io_, counted(std::move(task)));
}

std::unique_ptr<Executor> WorkerPool::strand() { return std::make_unique<Strand>(*this); }

void WorkerPool::stop() {
  stopping_ = true;
  work_.reset();
  for (auto& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
  // What was counted while the threads ended.
  for (; queued_ > 0; std::this_thread::yield()) {
    io_.restart();
    run_guarded(name_, io_);
  }
}

}  // namespace anchord::server
