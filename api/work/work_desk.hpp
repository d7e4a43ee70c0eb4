#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "api/admin/alarm_rules.hpp"
#include "api/admin/job_service.hpp"
#include "api/work/worker_port.hpp"
#include "core/ports/work_store.hpp"

namespace anchord::api {

class EventLog;

/// The server's end of work that any process of the database may do (docs/adr/0013): hands it out, shows how
/// it goes as jobs, takes results in, and does it here when nobody else does. What is out is in the database
/// alone, so a restart of the server changes nothing of it. Thread-safe.
class WorkDesk {
 public:
  struct Options {
    std::string version;  ///< of anchord: workers of another one claim nothing
    std::string worker;   ///< the name under which this server claims
    bool run_here{true};  ///< false: only workers run jobs
    std::chrono::milliseconds lease{15'000};
  };
  struct Deps {
    WorkStore& work;
    JobStore& job_store;
    JobService& jobs;
    EventLog& events;
    const Clock& clock;
    Executor& on;  ///< a strand for each kind of what is run here
    RunWork run;
    Options options;
  };
  /// One kind of job.
  struct Kind {
    /// What is to be done, for a job that a server of another version handed out and nobody has begun.
    std::function<Result<std::string>(const JobId& job)> message;
    /// What a result becomes. Called on the desk's thread, and again after a server that was killed between
    /// this and the end of the job: it finds out by itself whether it was done already.
    std::function<Result<JobEnd>(const Job& job, const std::string& result)> take_in;
    double done_before{0};       ///< of the whole, when it is handed out
    bool of_one_version{false};  ///< a result that was made by another version is made again
  };

  explicit WorkDesk(Deps deps);
  ~WorkDesk();
  WorkDesk(const WorkDesk&) = delete;
  WorkDesk& operator=(const WorkDesk&) = delete;

  /// Before start().
  void add(std::string kind, Kind how);
  void start();
  /// What runs here is given back; what workers run goes on. Idempotent.
  void stop();

  /// queue_full when JobService::k_max_queued of the kind wait.
  Result<void> room_for(const std::string& kind);
  Result<Job> submit(std::string kind, std::string request_json, std::string message, const JobId& id);
  /// The same job again. conflict while it waits, runs or has succeeded.
  Result<Job> restart(const JobId& id, std::string message);
  /// A job that JobService began here goes on wherever it is claimed: it waits again, as it is given. Its
  /// work returns JobEnd::elsewhere then.
  Result<void> hand_over(Job job, std::string message);
  /// Jobs wait and nobody is there who would run them; asks nobody.
  std::vector<AlarmCondition> alarms() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace anchord::api
