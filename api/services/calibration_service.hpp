#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "api/http/problem.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/localize/flight_options.hpp"
#include "core/ports/store.hpp"
#include "core/types/anchor.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::api {

class Hub;

/// A batch solve as asked for.
struct CalibrationRequest {
  std::vector<MissionId> missions;
  std::vector<MissionId>
      learn_from;  ///< other flights of the same kit: they tell its bias and lag, not positions
  FlightOptions options;
  std::string settings_json;  ///< as accepted
};

/// Reads the body of POST /calibrations; what is wrong is appended to `errors`. Settings this build does not
/// have (models, frame, use_anchor_anchor, ...) are refused as `unsupported`, never ignored.
CalibrationRequest read_calibration_request(const nlohmann::json& body, std::vector<FieldError>& errors);

/// All rows of a mission as the solver takes them.
Result<FlightData> load_flight(MeasurementStore& store, const Mission& mission,
                               const std::function<bool()>& canceled);

/// Batch solves as jobs: one at a time on one background thread, at most 16 waiting; state in the JobStore,
/// progress on topic `jobs`. Thread-safe.
class CalibrationService {
 public:
  static constexpr std::size_t k_max_queued = 16;
  struct Deps {
    MeasurementStore& measurements;
    MissionStore& missions;
    AnchorStore& anchors;
    JobStore& jobs;
    Hub& hub;
    const Clock& clock;
  };
  explicit CalibrationService(Deps deps);
  ~CalibrationService();

  /// Jobs of the last run become failed: interrupted. Starts the thread.
  void start();
  void stop();

  /// queue_full when too many wait; not_found for a mission that is not there.
  Result<Job> submit(CalibrationRequest request);
  /// Waits for the end of a job; the job as it is after that time otherwise.
  Result<Job> wait(const JobId& id, std::chrono::milliseconds longest);
  /// conflict when it has ended.
  Result<Job> cancel(const JobId& id);

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace anchord::api
