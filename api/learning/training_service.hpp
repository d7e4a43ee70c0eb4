#pragma once

#include <functional>
#include <string>

#include "api/work/worker_port.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

class JobService;
class JobContext;
struct JobEnd;
class EventLog;
class ModelSigner;
class WorkDesk;

/// Training runs as jobs of kind `training`: the rows go to a worker, what comes back is stored whole or not
/// at all. The worker is a child of this server or, where there is a desk, any process that has the database.
/// Thread-safe.
class TrainingService {
 public:
  struct Deps {
    DatasetStore& datasets;
    TrainingRunStore& runs;
    JobService& jobs;
    EventLog& events;
    const Clock& clock;
    RunWork run_work;
    std::string code_version;
    const ModelSigner& signer;
    WorkDesk* desk;  ///< null: nobody but this server runs jobs
  };
  explicit TrainingService(Deps deps);

  /// errors: not_found (data set), queue_full
  Result<Job> submit(const DatasetId& dataset, std::string task, std::string request_json, std::string by);
  /// A run that failed, was canceled or interrupted, from its beginning. conflict: it waits, runs or is done
  Result<Job> restart(const TrainingRunId& id);

 private:
  Result<std::string> message_of(const TrainingRun& run) const;
  std::function<Result<JobEnd>(JobContext&)> work_of(const TrainingRun& run);
  /// Reads, signs and stores what a worker answered. A run that has its model already keeps it.
  Result<JobEnd> take_in(const TrainingRun& run, const std::string& answer);
  Deps deps_;
};

/// The manifest of an artifact as JSON text.
std::string manifest_of(const std::string& artifact);

}  // namespace anchord::api
