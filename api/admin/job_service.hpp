#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "core/base/result.hpp"
#include "core/ports/job_store.hpp"

namespace anchord {
class Executor;
}

namespace anchord::api {

class Hub;

/// What a job tells about itself while it runs. Called from the job's thread.
class JobContext {
 public:
  virtual ~JobContext() = default;
  virtual const Job& job() const = 0;
  /// Written to the store and to topic `jobs`.
  virtual void progress(double fraction, std::string stage, std::string detail) = 0;
  /// Somebody canceled it, or the server stops: end soon with Errc::canceled.
  virtual bool canceled() const = 0;
};

struct JobEnd {
  std::string result_href{}, detail{};
  bool elsewhere{false};  ///< it has not ended: whoever took it over keeps its state from here on
};

/// Long work in bounded, visible queues: a strand for each kind, so that a calibration never waits for a
/// training run, at most 16 waiting of each. States live in the JobStore, progress goes to topic `jobs`.
/// Thread-safe.
class JobService {
 public:
  static constexpr std::size_t k_max_queued = 16;
  using Work = std::function<Result<JobEnd>(JobContext&)>;

  /// `on` has a thread for each kind that may run beside the others.
  JobService(JobStore& jobs, Hub& hub, const Clock& clock, Executor& on);
  ~JobService();
  JobService(const JobService&) = delete;
  JobService& operator=(const JobService&) = delete;

  /// Jobs of the last run become failed: interrupted, but for those that run elsewhere. From here on jobs
  /// run.
  void start();
  /// Asks what runs to end, and waits for it; what waits is marked interrupted by the next start.
  void stop();

  /// A job of a new id, or of the one given; it works for whom the caller works for (current_sites()).
  /// queue_full when too many of its kind wait.
  Result<Job> submit(std::string kind, std::string request_json, Work work, std::optional<JobId> id = {});
  /// The same job again under its own id, from the beginning. conflict while it waits, runs or has succeeded.
  Result<Job> restart(const JobId& id, Work work);
  /// Waits for the end of a job; the job as it is after that time otherwise.
  Result<Job> wait(const JobId& id, std::chrono::milliseconds longest);
  /// Jobs that other processes run, of which the caller keeps the state: they take no lane here.
  Result<Job> submit_elsewhere(std::string kind, std::string request_json, const JobId& id);
  /// As restart().
  Result<Job> restart_elsewhere(const JobId& id);
  /// A new state of such a job: written, told on topic `jobs` and to who waits.
  Result<void> save(const Job& job);
  /// Asked first when somebody cancels a job; true: it is canceled there. To be set before start().
  void cancel_elsewhere(std::function<Result<bool>(const JobId&)> cancel);

  /// conflict when it has ended.
  Result<Job> cancel(const JobId& id);

  /// Whether whom the caller works for may see the job: who is bound to sites, what was submitted for them
  /// alone since the start.
  bool seen(const JobId& id) const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace anchord::api
