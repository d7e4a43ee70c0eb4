#include "core/ml/parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <optional>
#include <thread>
#include <vector>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"

namespace anchord::ml {
namespace {

/// Of the first element that failed.
struct Outcome {
  std::size_t failed_at{static_cast<std::size_t>(-1)};
  std::optional<Error> error;
  std::exception_ptr thrown;
};

void fail(Locked<Outcome>& shared, Outcome now) {
  auto outcome = shared.lock();
  if (now.failed_at < outcome->failed_at) *outcome = std::move(now);
}

}  // namespace

Result<void> parallel_for(std::size_t n, const Execution& how,
                          const std::function<Result<void>(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  Locked<Outcome> shared;
  const auto run = [&] {
    for (std::size_t i; !failed && !how.cancelled() && (i = next++) < n;) {
      try {
        if (auto done = work(i); !done) {
          fail(shared, {i, done.error(), nullptr});
          failed = true;
        }
      } catch (...) {  // out of memory in a worker is the caller's to handle
        fail(shared, {i, std::nullopt, std::current_exception()});
        failed = true;
      }
    }
  };
  std::size_t threads = how.threads == 0 ? std::thread::hardware_concurrency() : how.threads;
  threads = std::clamp<std::size_t>(threads, 1, std::max<std::size_t>(n, 1));
  {
    std::vector<Thread> helpers;
    for (std::size_t t = 1; t < threads; ++t) helpers.emplace_back("anchord-ml", run);
    run();
    for (auto& helper : helpers) helper.join();
  }
  if (how.cancelled()) return make_error(Errc::canceled, "cancelled");
  const Outcome outcome = shared.copy();
  if (outcome.thrown) std::rethrow_exception(outcome.thrown);
  if (outcome.error) return *outcome.error;
  return boost::outcome_v2::success();
}

}  // namespace anchord::ml
