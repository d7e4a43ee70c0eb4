#pragma once

#include "api/application.hpp"
#include "api/services/calibration_service.hpp"
#include "api/services/event_log.hpp"
#include "api/services/ingest.hpp"
#include "api/services/job_service.hpp"
#include "api/services/mission_service.hpp"

namespace anchord::api {

class AlarmBoard;
class ContradictionWatch;
class DeviceStream;
class GeoService;
class Housekeeping;
class RunningTime;
class KitProfiles;
class ModelRegistry;

class Fields;
class FlightService;

/// What the routes work with; lives as long as the Application.
struct Services {
  Application::Deps& deps;
  Hub& hub;
  EventLog& events;
  AlarmBoard& alarms;
  MissionService& missions;
  IngestService& ingest;
  JobService& jobs;
  CalibrationService& calibrations;
  GeoService& geo;
  KitProfiles* profiles{nullptr};   ///< null: their routes do not exist
  ModelRegistry* models{nullptr};   ///< null: no ranges are judged (tests)
  FrameStore* frames{nullptr};      ///< null: their routes do not exist
  FlightService* flights{nullptr};  ///< null: no plans, nothing is flown (tests)
  AccessStore* prompt{nullptr};     ///< for commands: takes at once what it writes soon (LateWriter)
  DeviceStream* stream{nullptr};    ///< these three are set from the start
  RunningTime* running{nullptr};
  Housekeeping* housekeeping{nullptr};
  ContradictionWatch* contradictions{nullptr};  ///< set from the start too

  StorageStatus storage() const { return deps.storage_status ? deps.storage_status() : StorageStatus{}; }
  /// Begins a backup in a job. Errors: those of the job queue.
  Result<Job> begin_backup() const;
  /// One line in the audit log: who did what from where.
  void audit(const Request& request, std::string what, std::string result = "ok") const;
  /// The same of a command, which was given already and whose answer waits for the disk only a moment.
  void audit_soon(const Request& request, std::string what, std::string result = "ok") const;
};

/// A mission by the path: 404 where none ever was, 410 for one in the bin, with the way back.
Mission named_mission(Services& services, const Request& request);
/// With its ETag, which covers all that the body says.
Response mission_answer(Services& services, int status, const Mission& mission);
/// 409 no-control unless the request names the lease of this mission's control.
void require_control(Services& services, const Request& request, const MissionId& mission,
                     const std::string& lease, const std::string& what);

void add_mission_routes(Router& router, Services& services);
void add_mission_bin_routes(Router& router, Services& services);
void add_measurement_routes(Router& router, Services& services);
void add_site_routes(Router& router, Services& services);
void add_anchor_routes(Router& router, Services& services);
void add_comparison_routes(Router& router, Services& services);
void add_frame_routes(Router& router, Services& services);
void add_kit_routes(Router& router, Services& services);
void add_calibration_routes(Router& router, Services& services);
void add_device_routes(Router& router, Services& services);
void add_job_routes(Router& router, Services& services);
void add_plan_routes(Router& router, Services& services);
void add_alarm_routes(Router& router, Services& services);
void add_backup_routes(Router& router, Services& services);
void add_flight_routes(Router& router, Services& services);
/// Bodies of commands are small, and parsed before an executor is chosen.
inline constexpr std::uint64_t k_command_bytes = 16 * 1024;
/// Of POST /missions/{id}/actions, by the action.
Work work_of_action(const Request& request);
/// start, hold, resume, skip, return, land, abort.
const std::vector<std::string_view>& flight_actions();
Response flight_action(Services& services, const Request& request, const std::string& action, Fields& fields,
                       std::vector<FieldError>& errors);
void add_exclusion_routes(Router& router, Services& services);
void add_system_routes(Router& router, Services& services);

}  // namespace anchord::api
