#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "api/admin/build_info.hpp"
#include "api/kit/audit.hpp"
#include "api/kit/storage_status.hpp"
#include "core/base/result.hpp"

namespace anchord {
class AccessStore;
class Backups;
class Clock;
class JobStore;
class OrganizationStore;
class SiteStore;
struct Job;
}  // namespace anchord

namespace anchord::api {

class AccessService;
class AlarmBoard;
class CirRetention;
class EventLog;
class Hub;
class JobService;
class Router;

/// What the rest of the server counts, for GET /metrics and /system.
struct ServerCounts {
  bool recording{false};
  std::uint64_t queued_rows{0}, missions_followed{0}, missions_evicted{0};
  std::uint64_t lines_accepted{0}, lines_duplicate{0}, lines_rejected{0};
};

/// What the routes of administration work with; lives as long as the router.
struct AdminApi {
  const Clock& clock;
  Hub& hub;
  EventLog& events;
  AlarmBoard& alarms;
  JobService& jobs;
  JobStore& job_store;
  AccessStore& audit_log;
  Audit audit;
  BuildInfo build;
  Backups& backups;
  CirRetention& cir_retention;
  std::function<StorageStatus()> storage;
  std::function<ServerCounts()> counts;
  std::function<nlohmann::ordered_json()> device_clock, drone, mqtt;  ///< as /system shows them; null: none
  std::function<std::string()> metrics_text;  ///< Prometheus text of all others, after ours
  /// Name and content: what the rest of the server adds to a support bundle.
  std::function<std::vector<std::pair<std::string, std::string>>()> support_files;
};

/// What the routes of organizations work with.
struct OrganizationApi {
  OrganizationStore& organizations;
  const Clock& clock;
  Audit audit;
};

/// Begins a backup in a job. Errors: those of the job queue.
Result<Job> begin_backup(const AdminApi& admin);

/// /api/v1/tokens, /session, /me, /ws-tickets.
void add_access_routes(Router& router, AccessService& access, SiteStore& sites,
                       OrganizationStore& organizations);
void add_alarm_routes(Router& router, AdminApi& admin);
void add_backup_routes(Router& router, AdminApi& admin);
void add_cir_archive_routes(Router& router, AdminApi& admin);
void add_organization_routes(Router& router, OrganizationApi& organizations);
void add_job_routes(Router& router, AdminApi& admin);
void add_system_routes(Router& router, AdminApi& admin);

}  // namespace anchord::api
