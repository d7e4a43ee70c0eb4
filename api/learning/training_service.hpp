#pragma once

#include <functional>
#include <string>

#include "api/learning/worker_port.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

class JobService;
class JobContext;
class EventLog;
class ModelSigner;

/// Training runs as jobs of kind `training`: the rows go to a worker, what comes back is stored whole or not
/// at all. Thread-safe.
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
  };
  explicit TrainingService(Deps deps) : deps_(std::move(deps)) {}

  /// errors: not_found (data set), queue_full
  Result<Job> submit(const DatasetId& dataset, std::string task, std::string request_json, std::string by);
  /// A run that failed, was canceled or interrupted, from its beginning. conflict: it waits, runs or is done
  Result<Job> restart(const TrainingRunId& id);

 private:
  std::function<Result<std::string>(JobContext&)> work_of(const TrainingRun& run);
  Result<std::string> work(const TrainingRun& run, JobContext& job);
  Deps deps_;
};

/// The manifest of an artifact as JSON text.
std::string manifest_of(const std::string& artifact);

}  // namespace anchord::api
