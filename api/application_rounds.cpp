#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/application_state.hpp"
#include "api/mqtt/mqtt_status.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/text.hpp"
#include "core/ports/backups.hpp"
#include "core/ports/broker.hpp"
#include "core/ports/devices.hpp"

namespace anchord::api {
namespace {

/// An alarm about a failed task stands so long after the newest failure.
constexpr auto k_failure_stands = std::chrono::minutes(5);

}  // namespace

/// Mission states each half second, the rest each second.
void Application::State::beat() {
  for (std::uint64_t n = 1;; ++n) {
    {
      auto stop = stopping.lock();
      if (stop.wait_for(stop_told, std::chrono::milliseconds(500), [](bool told) { return told; })) return;
    }
    (void)guarded("mission states", [this] { missions.tick(); });
    if (n % 2 == 0) second();
  }
}

/// What has landed is solved at once, so that the result is there when the operator looks; a person publishes
/// it.
void Application::State::calibrate_landed() {
  for (const auto& id : flights.take_landed()) {
    if (!deps.calibrate_landed) continue;
    if (const auto n = stores.measurements.count_ranges(id); n && n.value() == 0)
      continue;  // nothing to solve
    std::vector<FieldError> none;
    const auto body = nlohmann::json{{"missions", {to_string(id)}}};
    auto request = read_calibration_request(body, none);
    request.settings_json = R"({"after_landing":true})";
    if (const auto job = calibrations.submit(std::move(request)); job)
      events.add(EventLevel::info, "calibration.after_landing",
                 "landed: all ranges are being solved together; the result waits for review", id);
    else
      events.add(EventLevel::warning, "calibration.not_started",
                 "not calibrated after landing: " + job.error().message, id);
  }
}

/// About once a second, on the thread of late writes; each part behind a guard of its own.
void Application::State::background_round() {
  (void)guarded("calibration after landing", [this] { calibrate_landed(); });
  (void)guarded("contradicted anchors", [this] { (void)contradictions.standing(); });
  (void)guarded("flights of omlox", [this] { omlox_locations.refresh(); });
  (void)guarded("last uses of tokens", [this] { deps.access.flush(); });
  (void)guarded("scheduled backup", [this] {
    // Daily and after every flight (reliability.md section 2).
    if (!deps.backups.due(missions.finished())) return;
    if (const auto begun = begin_backup(admin_api); !begun)
      events.add(EventLevel::warning, "backup.failed", begun.error().message);
  });
}

/// Each part behind the guard of its own: what fails in one must not keep the alarm about it from the page.
void Application::State::second() {
  const UtcTime now = deps.clock.now();
  ServerPulse pulse;
  // Alarms and heartbeats must not wait for the disk.
  late.idle_task([this] { background_round(); });
  (void)guarded("server status", [&] { publish_system(now, pulse); });
  (void)guarded("device clocks", [&] {
    pulse.clock_skew = deps.devices.clock().skew;
    pulse.unrecorded = deps.devices.recorder_failure();
    pulse.not_started = deps.devices.not_started();
  });
  (void)guarded("backups", [&] { pulse.not_backed_up = deps.backups.state().failure; });
  std::vector<FlightPulse> pulses;
  (void)guarded("mission states", [&] { pulses = missions.pulses(); });
  std::vector<std::pair<std::string_view, std::string>> of_flight;
  (void)guarded("flight alarms", [&] { of_flight = flights.alarms(); });
  for (const auto& failure : task_failures(k_failure_stands)) {
    pulse.failed_tasks +=
        (pulse.failed_tasks.empty() ? "" : "; ") + failure.task + " (" + to_utf8(failure.what, 120) + ')';
  }
  (void)guarded("alarms", [&] { publish_alarms(now, alarm_conditions(pulses, pulse), of_flight); });
}

void Application::State::publish_system(UtcTime now, ServerPulse& pulse) {
  const StorageStatus storage = deps.storage_status();
  std::string json = R"({"t_us":)" + std::to_string(now.us()) + R"(,"recording":)" +
                     (missions.recording() ? "true" : "false");
  json += R"(,"queue_depth":)" + std::to_string(storage.queue_depth + missions.queued()) + R"(,"db_bytes":)" +
          std::to_string(storage.db_bytes);
  json += R"(,"disk_free_bytes":)" + std::to_string(storage.disk_free_bytes) + R"(,"ws_clients":)" +
          std::to_string(hub.clients());
  json += R"(,"synchronous":)" + json_text(storage.synchronous) + '}';
  hub.publish(Topic::system, std::move(json), now.us());
  pulse.writable = storage.writable;
  pulse.reason = storage.reason;
  pulse.stalled = storage.stalled;
  pulse.disk_free_bytes = storage.disk_free_bytes;
  pulse.queued_rows = storage.queue_depth + missions.queued();
}

void Application::State::publish_alarms(UtcTime now, std::vector<AlarmCondition> holding,
                                        std::vector<std::pair<std::string_view, std::string>>& of_flight) {
  for (auto& [id, text] : of_flight) {
    const auto mission = flights.mission();
    const bool raised = std::ranges::any_of(holding, [&](const auto& c) { return c.is(id, mission); });
    if (!text.empty() && !raised)
      holding.push_back({std::string(id), AlarmPriority::critical, std::move(text), mission});
  }
  if (auto step = clock_watch.look(now, steady.now()); !step.empty())
    holding.push_back({"clock.step", AlarmPriority::warning, std::move(step), std::nullopt});
  if (deps.broker != nullptr) {
    if (auto away = broker_alarm(deps.broker->status()); !away.empty())
      holding.push_back({"mqtt.disconnected", AlarmPriority::warning, std::move(away), std::nullopt});
  }
  for (auto& alarm : deps.server_alarms()) holding.push_back(std::move(alarm));
  if (desk)
    for (auto& alarm : desk->alarms()) holding.push_back(std::move(alarm));
  for (auto& alarm : stream.alarms()) holding.push_back(std::move(alarm));
  for (auto& alarm : contradictions.alarms()) holding.push_back(std::move(alarm));
  alarms.update(std::move(holding), now);
  // With their sites: the hub asks while it is locked.
  std::vector<std::pair<Alarm, std::optional<SiteId>>> standing;
  for (auto& alarm : alarms.standing()) {
    const auto& mission = alarm.condition.mission;
    auto site = mission ? hub.site_of(*mission) : std::nullopt;
    standing.emplace_back(std::move(alarm), site);
  }
  const auto list = [standing = std::move(standing)](const SiteSet& sites) {
    std::string json = "[";
    for (const auto& [alarm, site] : standing)
      if (concerns(alarm, site, sites)) json += (json.size() > 1 ? "," : "") + alarm_json(alarm);
    return json + ']';
  };
  hub.publish_parts(Topic::alarms, list({}), now.us(), list);
}

}  // namespace anchord::api
