#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "core/base/guard.hpp"
#include "core/localize/flight_options.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {
struct FlightSolution;
}

namespace anchord::api {

/// Joint solutions of flights in the air, one at a time on a thread of its own: they take up to seconds, and
/// neither a request nor the live path may wait for them. Thread-safe.
class JointWorker {
 public:
  struct Task {
    FlightData flight;
    FlightOptions options;
    /// On the worker's thread; null when there is no solution (too few rows, canceled).
    std::function<void(const FlightSolution*)> done;
  };
  JointWorker();
  ~JointWorker();
  bool idle() const;
  /// False, and nothing happens, while another task runs or after stop().
  bool try_start(Task task);
  /// Cancels what runs and waits for its end.
  void stop();

 private:
  void loop();
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Task> next_;
  bool busy_{false}, stopping_{false};
  Thread thread_;
};

}  // namespace anchord::api
