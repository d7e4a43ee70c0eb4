#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "api/admin/alarm_rules.hpp"
#include "api/admin/build_info.hpp"
#include "api/heavy_work.hpp"
#include "api/kit/router.hpp"
#include "api/kit/storage_status.hpp"
#include "api/places/plan_work.hpp"
#include "api/stream/ws_handler.hpp"
#include "core/base/result.hpp"
#include "core/base/steady.hpp"
#include "core/geo/track_segments.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/ports/feature_file.hpp"
#include "core/ports/print_pdf.hpp"
#include "core/ports/stores.hpp"
#include "core/types/feature_table.hpp"

namespace anchord {
class Backups;
class Broker;
class CirArchive;
class Clock;
class DeviceControl;
class DeviceRows;
struct FlightData;
class Drone;
class Executor;
class WebPost;
class WorkStore;
}  // namespace anchord

namespace anchord::api {

class AccessService;
class Hub;

/// Everything above the sockets, put together: the one place that sees every feature of the API. Gets the
/// stores and the ports, makes the services, gives each feature's routes what they work with. Run by the
/// server. Thread-safe once start() returned.
class Application {
 public:
  /// Where each kind of work runs that no request waits for.
  struct Work {
    Executor& live;   ///< rows of live flights to estimates
    Executor& joint;  ///< joint solutions in flight
    Executor& plan;   ///< where a flight measures next, and what of it is long to write
    Executor& jobs;   ///< a strand for each kind of job
  };
  struct Deps {
    Stores stores;
    Work work;
    const Clock& clock;
    AccessService& access;
    Backups& backups;
    DeviceControl& devices;
    std::string model_key;  ///< 64 hex digits, what models are signed with
    BuildInfo build{};
    Drone* drone{nullptr};         ///< null: flights are flown by hand
    AccuracyGoal goal{};           ///< how well a live anchor must be known to count as converged
    bool site_outline{true};       ///< a site's outline is a prior for the anchors of its flights
    bool calibrate_landed{false};  ///< a flight is solved by itself once it has landed
    /// A flight to play on request.
    std::function<Result<FlightData>()> demonstration{};
    TrackLimits track{};      ///< what the positions of a flight are held against
    std::string geoid_dir{};  ///< empty: where GeographicLib looks
    std::function<StorageStatus()> storage_status = [] { return StorageStatus{}; };
    /// Prometheus text of the server, appended to ours.
    std::function<std::string()> metrics_text = [] { return std::string(); };
    /// Name and content: settings, log and what else only the server has, for a support bundle.
    std::function<std::vector<std::pair<std::string, std::string>>()> support_files = [] {
      return std::vector<std::pair<std::string, std::string>>{};
    };
    /// Conditions that only the server sees, of its certificate for example; asked every second.
    std::function<std::vector<AlarmCondition>()> server_alarms = [] { return std::vector<AlarmCondition>{}; };
    std::function<void(std::string_view request_id, std::string_view what)> log_fault =
        [](std::string_view, std::string_view) {};
    RunWork run_work = work_inline;  ///< runs the heavy part of jobs that may run apart from the server
    /// Work that other processes may do; null: every job is this process's.
    WorkStore* work_store{nullptr};
    bool run_jobs_here{true};  ///< where others may run jobs, this process does too
    std::chrono::milliseconds job_lease{
        15'000};                        ///< how long a claim of this process holds without a sign of it
    std::string worker_name{"server"};  ///< under which it claims
    RunWork run_plan_work = plan_work_inline;  ///< decodes, turns and traces pictures of plans
    bool model_key_is_new{false};              ///< models of before it existed are signed at the start
    std::int64_t keep_deleted_ns{30LL * 86'400 * 1'000'000'000};  ///< a deleted mission, in running time
    CirArchive* cir_archive{nullptr};  ///< null: impulse responses stay in the database
    std::optional<std::int64_t>
        keep_cir_days{};  ///< after landing, until they go into files; absent: for ever
    const SteadyClock* steady{&system_steady_clock()};  ///< what every duration is measured by
    /// The bytes of a GeoPackage; unset: there is nobody who writes one.
    std::function<Result<std::string>(std::span<const FeatureTable>, UtcTime)> geopackage =
        [](std::span<const FeatureTable>, UtcTime) -> Result<std::string> {
      return Error{Errc::unsupported, "this program writes no GeoPackage"};
    };
    /// The same on the disk, for many rows.
    MakeFeatureFile feature_file = [](const std::filesystem::path&, const FeatureTable&,
                                      UtcTime) -> Result<std::unique_ptr<FeatureFile>> {
      return Error{Errc::unsupported, "this program writes no GeoPackage"};
    };
    PrintPdf print_pdf = [](const std::filesystem::path&, const std::filesystem::path&) -> Result<void> {
      return Error{Errc::unsupported, "this program prints no PDF"};
    };
    /// Where bundles are made and uploads of them wait; emptied by whoever owns it.
    std::filesystem::path spool_dir{std::filesystem::temp_directory_path() / "anchord-spool"};
    WebPost* web_post{nullptr};              ///< null: webhooks are not served
    std::vector<double> webhook_waits_s{};   ///< from one attempt to the next; empty: those of the service
    Broker* broker{nullptr};                 ///< null: nothing is published by MQTT
    std::string mqtt_prefix{"anchord"};      ///< of every topic
    std::function<double()> flight_clock{};  ///< steady seconds; set: fly() is called by hand
    bool housekeeping_by_hand{false};        ///< set: housekeeping_round() is called by hand
  };

  explicit Application(Deps deps);
  ~Application();
  Application(const Application&) = delete;
  Application& operator=(const Application&) = delete;

  Router& router();
  /// The answer to a GET where it is at hand, encoded: never waits for the disk. None: the router's to make.
  std::optional<Response> at_hand(const Route& route, const Request& request) const;
  WsHandlerFactory ws_factory();
  /// At /omlox/v2/ws/socket, whose clients send their token in a message.
  TokenWsFactory omlox_ws_factory();
  Hub& hub();
  /// Where rows of this server's own devices go.
  DeviceRows& device_rows();
  /// Marks jobs of the last run as interrupted, but for those that workers have, starts heartbeats and the
  /// job thread.
  void start();
  /// Sends what was collected for the streams; to be called every 50 ms from start() to stop(), on the thread
  /// that writes the sockets.
  void stream_round();
  /// One round of the flight in the air; only where Deps::flight_clock is set.
  void fly();
  /// Removes what is due; only where Deps::housekeeping_by_hand is set.
  void housekeeping_round();
  /// What flies holds, and nothing is commanded any more. Idempotent; stop() does it too.
  void halt();
  /// Says bye to WebSocket clients, parks jobs, joins. Idempotent.
  void stop();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::api
