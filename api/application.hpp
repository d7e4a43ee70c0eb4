#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "api/admin/build_info.hpp"
#include "api/kit/router.hpp"
#include "api/kit/storage_status.hpp"
#include "api/learning/learning_stores.hpp"
#include "api/learning/worker_port.hpp"
#include "api/stream/ws_handler.hpp"
#include "core/geo/track_segments.hpp"
#include "core/localize/accuracy_goal.hpp"

namespace anchord {
class AccessStore;
class Backups;
class AnchorStore;
class Clock;
class DeviceControl;
class DeviceRows;
class ExclusionStore;
class FrameStore;
class Drone;
class JobStore;
class KitStore;
class MeasurementStore;
class MissionBin;
class MissionStore;
class PlanStore;
class ServiceStore;
class SteadyClock;
}  // namespace anchord

namespace anchord::api {

class AccessService;
class Hub;

/// Everything above the sockets, put together: the one place that sees every feature of the API. Gets the
/// stores and the ports, makes the services, gives each feature's routes what they work with. Run by the
/// server. Thread-safe once start() returned.
class Application {
 public:
  struct Deps {
    MeasurementStore& measurements;
    MissionStore& missions;
    AnchorStore& anchors;
    JobStore& jobs;
    AccessStore& access_store;
    const Clock& clock;
    BuildInfo build{};
    PlanStore* plans{nullptr};       ///< null: plans and flights do not exist (tests)
    AccessService* access{nullptr};  ///< tokens, sessions, tickets; null: those routes do not exist (tests)
    /// Runs a task on the pool; absent: on the calling thread.
    std::function<void(std::function<void()>)> post{};
    Backups* backups{nullptr};  ///< null: their routes do not exist and none are made
    AccuracyGoal goal{};        ///< how well a live anchor must be known to count as converged
    bool site_outline{true};    ///< a site's outline is a clue for the anchors of its flights
    std::function<StorageStatus()> storage_status{};
    KitStore* kits{nullptr};                      ///< null: no kit profiles (tests)
    FrameStore* frames{nullptr};                  ///< null: no local frames (tests)
    ExclusionStore* exclusions{nullptr};          ///< null: their routes do not exist (tests)
    TrackLimits track{};                          ///< what the positions of a flight are held against
    DeviceControl* devices{nullptr};              ///< of this server; null: it has none
    std::string geoid_dir{};                      ///< empty: where GeographicLib looks
    Drone* drone{nullptr};                        ///< null: flights are flown by hand
    std::function<double()> flight_clock{};       ///< steady seconds; set: fly() is called by hand (tests)
    std::function<std::string()> metrics_text{};  ///< Prometheus text of the server, appended to ours
    std::function<void(std::string_view request_id, std::string_view what)> log_fault{};
    LearningStores* learning{nullptr};  ///< null: the routes of learning do not exist (tests)
    MissionBin* bin{nullptr};           ///< null: no mission can be deleted (tests)
    ServiceStore* service{nullptr};     ///< null: running time and whose the devices are end with the process
    const SteadyClock* steady{nullptr};  ///< what every duration is measured by; null: the system's
    std::int64_t keep_deleted_ns{30LL * 86'400 * 1'000'000'000};  ///< a deleted mission, in running time
    bool housekeeping_by_hand{false};  ///< set: housekeeping_round() is called by hand (tests)
    std::string model_key{};       ///< 64 hex digits, what models are signed with; empty: none are (tests)
    bool model_key_is_new{false};  ///< models of before it existed are signed at the start
    RunWork run_work{};            ///< runs heavy work; absent: on the job's own thread
  };

  explicit Application(Deps deps);
  ~Application();
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;

  Router& router();
  WsHandlerFactory ws_factory();
  Hub& hub();
  /// Where rows of this server's own devices go.
  DeviceRows& device_rows();
  /// Marks jobs of the last run as interrupted, starts heartbeats and the job thread.
  void start();
  /// One round of the flight in the air; only where Deps::flight_clock is set (tests).
  void fly();
  /// Removes what is due; only where Deps::housekeeping_by_hand is set (tests).
  void housekeeping_round();
  /// Says bye to WebSocket clients, parks jobs, joins. Idempotent.
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::api
