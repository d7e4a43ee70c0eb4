#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "api/admin/alarm_board.hpp"
#include "api/admin/cir_retention.hpp"
#include "api/admin/docs_page.hpp"
#include "api/admin/event_log.hpp"
#include "api/admin/routes.hpp"
#include "api/admin/support_bundle.hpp"
#include "api/kit/contract.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/html_page.hpp"
#include "api/kit/support.hpp"
#include "api/stream/hub.hpp"
#include "core/base/time.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/backups.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

Response ready(AdminApi& s, const Request&) {
  const StorageStatus storage = s.storage();
  Ordered body{{"status", storage.writable ? "ready" : "degraded"},
               {"checks",
                {{"db", storage.writable ? "ok" : storage.reason},
                 {"disk", storage.writable ? "ok" : storage.reason},
                 {"migrations", "ok"}}}};
  return json_response(storage.writable ? 200 : 503, body);
}

Response version(AdminApi& s, const Request&) {
  const auto& build = s.build;
  return json_response(200, {{"version", build.version},
                             {"git", build.git},
                             {"schema", build.schema},
                             {"api", "v1"},
                             {"build", build.build},
                             {"compiler", build.compiler}});
}

Response system(AdminApi& s, const Request&) {
  const StorageStatus storage = s.storage();
  const ServerCounts counts = s.counts();
  Ordered body{{"t_us", s.clock.now().us()},
               {"recording", counts.recording},
               {"queue_depth", storage.queue_depth + counts.queued_rows},
               {"db_bytes", storage.db_bytes},
               {"disk_free_bytes", storage.disk_free_bytes},
               {"ws_clients", s.hub.clients()},
               {"synchronous", storage.synchronous},
               {"writable", storage.writable},
               {"reason", storage.reason}};
  // As topic `system` has it; which aircraft, broker and flights there are beside is not for who is bound.
  if (!current_sites().all()) return json_response(200, body);
  body["clock"] = s.device_clock();
  body["drone"] = s.drone();
  body["mqtt"] = s.mqtt();
  body["cir_archive"] = s.cir_retention.status();
  return json_response(200, body);
}

Response metrics(AdminApi& s, const Request&) {
  const ServerCounts counts = s.counts();
  auto& live = s.hub.counters();
  const StorageStatus storage = s.storage();
  std::string text;
  const auto add = [&text](const std::string& name, const char* type, std::uint64_t value, const char* help,
                           const std::string& labels = {}) {
    if (text.find("# TYPE " + name + ' ') == std::string::npos)
      text += "# HELP " + name + ' ' + help + "\n# TYPE " + name + ' ' + type + '\n';
    text += name + labels + ' ' + std::to_string(value) + '\n';
  };
  const char* lines = "Rows of ranges and positions received, by result";
  add("anchord_ingest_lines_total", "counter", counts.lines_accepted, lines, "{result=\"accepted\"}");
  add("anchord_ingest_lines_total", "counter", counts.lines_duplicate, lines, "{result=\"duplicate\"}");
  add("anchord_ingest_lines_total", "counter", counts.lines_rejected, lines, "{result=\"rejected\"}");
  std::map<AlarmPriority, std::uint64_t> active;
  for (const auto& alarm : s.alarms.standing()) ++active[alarm.condition.priority];
  for (const auto priority : {AlarmPriority::critical, AlarmPriority::warning, AlarmPriority::advisory})
    add("anchord_alarms", "gauge", active[priority], "Active alarms, by priority",
        "{priority=\"" + std::string(k_alarm_priority_words.word(priority)) + "\"}");
  add("anchord_ws_published_total", "counter", live.published, "Messages published on the live topics");
  add("anchord_ws_dropped_total", "counter", live.dropped,
      "Messages dropped for clients that read too slowly");
  add("anchord_ws_conflated_total", "counter", live.conflated,
      "Messages replaced by a newer one of their key");
  add("anchord_ws_slow_disconnects_total", "counter", live.slow_disconnects,
      "Clients disconnected because they read too slowly");
  add("anchord_live_queue_rows", "gauge", counts.queued_rows, "Rows that are waiting for the live estimates");
  add("anchord_live_missions", "gauge", counts.missions_followed, "Missions in memory");
  add("anchord_live_missions_evicted_total", "counter", counts.missions_evicted,
      "Missions removed from memory to make room for another one");
  add("anchord_db_size_bytes", "gauge", storage.db_bytes, "Size of the database");
  add("anchord_disk_free_bytes", "gauge", storage.disk_free_bytes, "Free space where the database is");
  if (storage.stood_by)
    add("anchord_standby_waiting", "gauge", *storage.stood_by ? 1 : 0,
        "1 while another server waits to take over");
  if (!s.backups.refusal()) {
    const BackupState backups = s.backups.state();
    add("anchord_backup_failed", "gauge", backups.failure.empty() ? 0 : 1,
        "1 while the last attempt made no backup");
    if (backups.newest)
      add("anchord_backup_newest_timestamp_seconds", "gauge",
          static_cast<std::uint64_t>(std::max<std::int64_t>(0, backups.newest->us() / 1'000'000)),
          "When the newest backup was made, by the server's clock");
  }
  text += s.metrics_text();
  Response response;
  response.header("Content-Type", "text/plain; version=0.0.4; charset=utf-8");
  response.body = std::move(text);
  return response;
}

constexpr std::size_t k_supported_events = 1000;
constexpr std::string_view k_read_me =
    "What an anchord server reports about itself, to find out what is wrong with it.\nLeft out: passwords, "
    "tokens, keys, measurements, positions of anchors.\nRead it before you send it.\n";

/// One archive for whoever helps from afar.
Response support(AdminApi& s, const Request& request) {
  check_query(request, {});
  std::string alarms, events;
  for (const auto& alarm : s.alarms.standing()) alarms += alarm_json(alarm) + '\n';
  for (auto& event : s.events.newest(k_supported_events, {}, {})) {
    event.place.reset();
    events += event_json(event) + '\n';
  }
  std::vector<SupportFile> files{
      {"README.txt", std::string(k_read_me)},   {"version.json", version(s, request).body},
      {"system.json", system(s, request).body}, {"metrics.txt", metrics(s, request).body},
      {"alarms.jsonl", std::move(alarms)},      {"events.jsonl", std::move(events)}};
  for (auto& file : s.support_files()) files.push_back(std::move(file));
  for (auto& [name, content] : files) content = without_secrets(content);
  s.audit.soon(request, "support.bundle");
  Response response;
  response.header("Content-Type", "application/x-tar");
  response.header("Content-Disposition", "attachment; filename=\"anchord-support.tar\"");
  response.body = tar_of(files, s.clock.now());
  return response;
}

Response document(std::string_view text) {
  Response response;
  response.header("Content-Type", "application/json");
  response.body = text;
  return response;
}

Response audit_log(AdminApi& s, const Request& request) {
  check_query(request, {"limit"});
  Ordered items = Ordered::array();
  for (const auto& entry : value_or_problem(s.audit_log.audit(page_query(request).limit))) {
    items.push_back({{"at", to_rfc3339(entry.time)},
                     {"who", entry.who},
                     {"what", entry.what},
                     {"from", entry.from},
                     {"result", entry.result}});
  }
  return list_response(request, std::move(items), "");
}

Response explain(const Request& request) {
  for (const auto& known : problem_types()) {
    if (known.type == request.params.at("type"))
      return json_response(200, {{"type", "/problems/" + std::string(known.type)},
                                 {"title", known.title},
                                 {"explanation", known.explanation}});
  }
  throw_problem(404, "not-found", "there is no such problem type");
}

}  // namespace

void add_system_routes(Router& router, AdminApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  router.add({Method::get, "/healthz", Access::open(), [](const Request&) {
                return json_response(200, {{"status", "ok"}});
              }});
  router.add(as_command({Method::get, "/readyz", Access::open(), on(ready)}));
  router.add({Method::get, "/version", Access::open(), on(version)});
  router.add({Method::get, "/metrics", readers(), on(metrics)});
  router.add({Method::get, "/problems/{type}", Access::open(), explain});
  router.add({Method::get, "/api/v1/system", readers(), on(system)});
  router.add(as_heavy({Method::get, "/api/v1/support-bundle", Access::any_of({Role::admin}), on(support)}));
  router.add(as_heavy({Method::get, "/api/v1/audit", Access::any_of({Role::admin}), on(audit_log)}));
  router.add({Method::get, "/api/docs", Access::open(), [](const Request&) {
                static const std::string page = docs_page(openapi_json());
                return html_page(page);
              }});
  router.add({Method::get, "/api/v1/openapi.json", Access::open(),
              [](const Request&) { return document(openapi_json()); }});
  router.add({Method::get, "/api/v1/asyncapi.json", Access::open(),
              [](const Request&) { return document(asyncapi_json()); }});
  router.add({Method::get, "/api/v1/ws", readers(), [](const Request&) -> Response {
                Response response = problem(
                    426, "method", "this is a WebSocket of subprotocol anchord.v1: ask for an upgrade");
                response.header("Upgrade", "websocket");
                return response;
              }});
}

}  // namespace anchord::api
