#include "api/application.hpp"

#include <algorithm>
#include <condition_variable>
#include <nlohmann/json.hpp>

#include "api/admin/access.hpp"
#include "api/admin/alarm_board.hpp"
#include "api/admin/clock_watch.hpp"
#include "api/admin/event_log.hpp"
#include "api/admin/housekeeping.hpp"
#include "api/admin/job_service.hpp"
#include "api/admin/routes.hpp"
#include "api/admin/running_time.hpp"
#include "api/anchors/anchor_answers.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/anchors/geo_service.hpp"
#include "api/anchors/published_features.hpp"
#include "api/anchors/routes.hpp"
#include "api/bundles/bundle_notes.hpp"
#include "api/bundles/routes.hpp"
#include "api/calibration/calibration_service.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/calibration/revision_news.hpp"
#include "api/calibration/routes.hpp"
#include "api/devices/device_json.hpp"
#include "api/devices/device_stream.hpp"
#include "api/devices/routes.hpp"
#include "api/exchange/anchor_files.hpp"
#include "api/exchange/routes.hpp"
#include "api/flight/flight_service.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/flight/routes.hpp"
#include "api/kit/late_writer.hpp"
#include "api/learning/promotion_events.hpp"
#include "api/learning/routes.hpp"
#include "api/measurements/demonstration.hpp"
#include "api/measurements/device_ingest.hpp"
#include "api/measurements/ingest.hpp"
#include "api/measurements/routes.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/routes.hpp"
#include "api/mqtt/mqtt_publisher.hpp"
#include "api/mqtt/mqtt_status.hpp"
#include "api/omlox/omlox_conversation.hpp"
#include "api/omlox/omlox_locations.hpp"
#include "api/omlox/omlox_push.hpp"
#include "api/omlox/routes.hpp"
#include "api/places/routes.hpp"
#include "api/planning/routes.hpp"
#include "api/planning/site_structures.hpp"
#include "api/stream/conversation.hpp"
#include "api/stream/hub.hpp"
#include "api/webhooks/routes.hpp"
#include "api/webhooks/webhook_service.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/ed25519.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/backups.hpp"
#include "core/ports/broker.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/drone.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {
namespace {

/// An alarm about a failed task stands so long after the newest failure.
constexpr auto k_failure_stands = std::chrono::minutes(5);

}  // namespace

struct Application::State {
  explicit State(Deps d)
      : deps(std::move(d)),
        stores(deps.stores),
        steady(*deps.steady),
        late([this](std::string_view what) { deps.log_fault("", what); }),
        prompt(stores.access, late),
        running(stores.service, steady),
        router(
            stores.access, [this] { return running.now_ns(); }, prompt),
        hub(deps.clock, "anchord " + deps.build.version),
        events(hub, deps.clock),
        alarms(events),
        signer(ModelSigner::parse_seed(deps.model_key).value()),
        models(ModelSource(stores.models, signer)),
        missions({.missions = stores.missions,
                  .measurements = stores.measurements,
                  .sites = stores.sites,
                  .anchors = stores.anchors,
                  .hub = hub,
                  .events = events,
                  .clock = deps.clock,
                  .steady = steady,
                  .live = deps.work.live,
                  .joint = deps.work.joint,
                  .late = late,
                  .exclusions = stores.exclusions,
                  .goal = deps.goal,
                  .device_rows = [this] { return device_rows(); },
                  .predict = [this](const Range& range) { return predict_range(*models.active(), range); },
                  .predict_needs_cir = [this] { return models.active()->needs_cir; },
                  .site_outline = deps.site_outline,
                  .track = deps.track,
                  .kept_priors = [this](const MissionId& id) { return priors_of_flight(id); }}),
        structures(stores.places),
        flights({.missions = missions,
                 .plans = stores.plans,
                 .structures = structures,
                 .hub = hub,
                 .events = events,
                 .clock = deps.clock,
                 .steady = steady,
                 .plan = deps.work.plan,
                 .late = late,
                 .drone = deps.drone,
                 .storage = deps.storage_status,
                 .now_s = deps.flight_clock}),
        stream({deps.devices, stores.service, stores.missions, events}),
        housekeeping({stores.bin, running, events, [this] { return router.purge_answers(); },
                      deps.keep_deleted_ns, deps.housekeeping_by_hand}),
        ingest(stores.measurements, missions),
        device_ingest(stores.measurements, missions),
        demonstration({missions, device_ingest, events, deps.clock, deps.demonstration}),
        jobs(stores.jobs, hub, deps.clock, deps.work.jobs),
        geo(deps.geoid_dir),
        contradictions({stores.anchors, stores.calibrations, stores.revisions, stores.missions, events}),
        profiles(stores.kits, stores.missions, deps.clock),
        calibrations({.measurements = stores.measurements,
                      .missions = stores.missions,
                      .sites = stores.sites,
                      .calibrations = stores.calibrations,
                      .jobs = jobs,
                      .clock = deps.clock,
                      .profiles = profiles,
                      .models = models,
                      .flight_priors = [this](const MissionId& id) { return priors_of_flight(id); },
                      .frames = stores.frames,
                      .exclusions = stores.exclusions,
                      .track = deps.track,
                      .contradictions = contradictions}),
        training({stores.datasets, stores.training_runs, jobs, events, deps.clock, deps.run_work,
                  deps.build.version, signer}),
        omlox_locations(hub, stores.missions),
        omlox_push({anchor_api, stores.places, omlox_locations, deps.web_post}),
        webhooks({stores.webhooks, deps.web_post, deps.clock, [this] { return running.now_ns(); },
                  deps.webhook_waits_s.empty() ? k_webhook_waits_s : deps.webhook_waits_s, &omlox_push}),
        audit(stores.access, prompt, deps.clock),
        admin_api{deps.clock,
                  hub,
                  events,
                  alarms,
                  jobs,
                  stores.jobs,
                  prompt,
                  audit,
                  deps.build,
                  deps.backups,
                  deps.storage_status,
                  [this] { return counts(); },
                  [this] { return device_clock(); },
                  [this] { return drone(); },
                  [this] { return mqtt(); },
                  [this] {
                    return flights.metrics() +
                           (deps.broker == nullptr ? "" : broker_metrics(deps.broker->status())) +
                           deps.metrics_text();
                  },
                  deps.support_files},
        device_api{deps.devices, stores.measurements, stream, jobs, audit},
        mission_api{
            missions,     stores.missions, stores.measurements,  stores.sites, stores.bin, stream, events,
            housekeeping, running,         deps.keep_deleted_ns, deps.clock,   audit,      flights},
        measurement_api{stores.measurements, ingest, missions,     models, stores.exclusions, events,
                        deps.clock,          audit,  demonstration},
        anchor_answers(stores.revisions, contradictions),
        anchor_api{stores.sites,
                   stores.anchors,
                   stores.calibrations,
                   stores.revisions,
                   stores.frames,
                   missions,
                   geo,
                   contradictions,
                   deps.clock,
                   audit},
        calibration_api{calibrations,
                        stores.calibrations,
                        stores.revisions,
                        stores.sites,
                        stores.anchors,
                        stores.missions,
                        missions,
                        contradictions,
                        profiles,
                        jobs,
                        hub,
                        events,
                        deps.clock,
                        audit,
                        "anchord " + deps.build.version},
        planning_api{stores.plans,
                     stores.sites,
                     deps.clock,
                     audit,
                     [this](const PlanId& id) { return flights.flown_with(id); },
                     [this](const Plan& plan) { flights.plan_saved(plan); },
                     structures},
        flight_api{flights, mission_api, events, audit},
        publisher({hub, stores.missions, stores.sites, stores.revisions,
                   [this] {
                     std::uint64_t newest = 0;
                     return published_features(anchor_api, std::nullopt, newest);
                   },
                   steady, deps.mqtt_prefix, deps.build.version}),
        exchange_api{anchor_api, stores.missions, stores.measurements, stores.places, deps.geopackage},
        webhook_api{stores.webhooks, webhooks, deps.web_post, deps.clock, audit},
        omlox_api{anchor_api, stores.places, omlox_locations, deps.clock},
        place_api{stores.places, stores.sites, jobs,  deps.run_plan_work,
                  deps.clock,    steady,       audit, [this] { structures.changed(); }},
        bundle_api{.bundles = stores.bundles,
                   .clock = deps.clock,
                   .audit = audit,
                   .made_by = "anchord " + deps.build.version,
                   .spool = deps.spool_dir,
                   .named = [this](const Request& request) { return named_mission(mission_api, request); },
                   .notes =
                       [this](const Mission& mission, const Principal& who) {
                         return bundle_notes(events, stores.access, mission, who);
                       },
                   .taken = [this](const MissionId& id, const std::string& text,
                                   bool published) { announce_bundle(calibration_api, id, text, published); },
                   .calibrations = stores.calibrations,
                   .revisions = stores.revisions,
                   .key = signer.key(),
                   .ask = [this](Request& request) { return router.handle(request); },
                   .measurements = stores.measurements,
                   .feature_file = deps.feature_file},
        learning_stores{stores.campaigns, stores.labels, stores.datasets, stores.training_runs,
                        stores.models},
        learning_api{learning_stores,
                     training,
                     models,
                     stores.measurements,
                     stores.missions,
                     stores.exclusions,
                     jobs,
                     stores.jobs,
                     events,
                     [this](const std::string& code, const std::string& text) {
                       missions.note_in_flights(code, text);
                     },
                     deps.clock,
                     audit} {
    missions.observe(&flights);
    mission_api.flight = flight_actions(flight_api);
    anchor_api.answers = &anchor_answers;
    anchor_api.file = [this](std::string_view format, const Request& request) {
      return anchor_file(exchange_api, format, request);
    };
    router.on_fault(deps.log_fault);
    add_mission_routes(router, mission_api);
    add_mission_bin_routes(router, mission_api);
    add_measurement_routes(router, measurement_api);
    add_site_routes(router, anchor_api);
    add_anchor_routes(router, anchor_api);
    add_calibration_routes(router, calibration_api);
    add_comparison_routes(router, calibration_api);
    add_datum_routes(router, calibration_api);
    add_kit_routes(router, calibration_api);
    add_frame_routes(router, anchor_api);
    add_exclusion_routes(router, measurement_api);
    add_device_routes(router, device_api);
    add_job_routes(router, admin_api);
    add_plan_routes(router, planning_api);
    add_flight_routes(router, flight_api);
    add_plan_change_routes(router, flight_api);
    add_campaign_routes(router, learning_api);
    add_dataset_routes(router, learning_api);
    add_training_run_routes(router, learning_api);
    add_model_routes(router, learning_api);
    add_access_routes(router, deps.access);
    add_alarm_routes(router, admin_api);
    add_backup_routes(router, admin_api);
    add_system_routes(router, admin_api);
    add_ogc_routes(router, exchange_api);
    add_anchor_file_routes(router, exchange_api);
    add_webhook_routes(router, webhook_api);
    add_omlox_routes(router, omlox_api);
    add_building_routes(router, place_api);
    add_floor_routes(router, place_api);
    add_floor_plan_routes(router, place_api);
    add_bundle_routes(router, bundle_api);
    add_handover_routes(router, bundle_api);
    events.on_event([this](const LiveEvent& event) { webhooks.notify(event); });
  }

  ServerCounts counts() const {
    const auto& lines = ingest.counters();
    return {missions.recording(), missions.queued(), missions.followed(), missions.evicted(),
            lines.accepted,       lines.duplicates,  lines.rejected};
  }
  nlohmann::ordered_json device_clock() const { return clock_json(deps.devices.clock()); }
  nlohmann::ordered_json drone() const {
    return deps.drone == nullptr ? nlohmann::ordered_json(nullptr) : drone_json(deps.drone->status());
  }

  nlohmann::ordered_json mqtt() const {
    return deps.broker == nullptr ? nlohmann::ordered_json(nullptr) : broker_json(deps.broker->status());
  }

  /// Once, when the key is new: what a run made here, and what was promoted before promotions judged uploads.
  void sign_models_of_before();

  /// What turns and height searches of a mission's flight told, as kept with it.
  procedure::FlightPriors priors_of_flight(const MissionId& id) const {
    const auto kept = stores.plans.procedures();
    if (!kept) return {};
    for (const auto& [mission, text] : kept.value()) {
      const auto j = nlohmann::json::parse(text, nullptr, false);
      if (mission == id && j.is_object()) return priors_of(j.value("clues", nlohmann::json()));
    }
    return {};
  }

  void beat();
  std::string device_rows();
  void second();
  void background_round();
  void calibrate_landed();
  void publish_system(UtcTime now, ServerPulse& pulse);
  void publish_alarms(UtcTime now, std::vector<AlarmCondition> holding,
                      std::vector<std::pair<std::string_view, std::string>>& of_flight);

  Deps deps;
  const Stores& stores;
  const SteadyClock& steady;
  LateWriter late;
  PromptAccessStore prompt;
  RunningTime running;
  Router router;
  Hub hub;
  EventLog events;
  AlarmBoard alarms;
  ModelSigner signer;
  ModelRegistry models;
  MissionService missions;
  SiteStructures structures;
  FlightService flights;
  DeviceStream stream;
  Housekeeping housekeeping;
  ClockWatch clock_watch;
  IngestService ingest;
  DeviceIngest device_ingest;
  Demonstration demonstration;
  JobService jobs;
  GeoService geo;
  ContradictionWatch contradictions;
  KitProfiles profiles;
  CalibrationService calibrations;
  TrainingService training;
  OmloxLocations omlox_locations;
  OmloxPush omlox_push;  ///< reads through anchor_api, once everything is there
  WebhookService webhooks;
  Audit audit;
  AdminApi admin_api;
  DeviceApi device_api;
  MissionApi mission_api;
  MeasurementApi measurement_api;
  AnchorAnswers anchor_answers;
  AnchorApi anchor_api;
  CalibrationApi calibration_api;
  PlanningApi planning_api;
  FlightApi flight_api;
  MqttPublisher publisher;
  ExchangeApi exchange_api;
  WebhookApi webhook_api;
  OmloxApi omlox_api;
  PlaceApi place_api;
  BundleApi bundle_api;
  LearningStores learning_stores;
  LearningApi learning_api;
  Locked<bool> stopping{false};
  std::condition_variable stop_told;
  bool started{false};
  Thread heart;
};

/// Rows of topic `devices` for what is set up here.
std::string Application::State::device_rows() {
  std::string out;
  for (const auto& device : deps.devices.devices()) {
    out += (out.empty() ? "" : ",") + to_wire(device_row_json(device));
  }
  return out;
}

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
                 "landed: all ranges are solved again, together; the result waits for review", id);
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
  pulse.disk_free_bytes = storage.disk_free_bytes;
  pulse.queued_rows = storage.queue_depth + missions.queued();
}

void Application::State::publish_alarms(UtcTime now, std::vector<AlarmCondition> holding,
                                        std::vector<std::pair<std::string_view, std::string>>& of_flight) {
  for (auto& [id, text] : of_flight) {
    const bool told = std::any_of(holding.begin(), holding.end(), [&](const auto& c) { return c.id == id; });
    if (!text.empty() && !told)
      holding.push_back({std::string(id), AlarmPriority::critical, std::move(text), std::nullopt});
  }
  if (auto step = clock_watch.look(now, steady.now()); !step.empty())
    holding.push_back({"clock.step", AlarmPriority::warning, std::move(step), std::nullopt});
  if (deps.broker != nullptr) {
    if (auto away = broker_alarm(deps.broker->status()); !away.empty())
      holding.push_back({"mqtt.disconnected", AlarmPriority::warning, std::move(away), std::nullopt});
  }
  for (auto& alarm : deps.server_alarms()) holding.push_back(std::move(alarm));
  for (auto& alarm : stream.alarms()) holding.push_back(std::move(alarm));
  for (auto& alarm : contradictions.alarms()) holding.push_back(std::move(alarm));
  alarms.update(std::move(holding), now);
  std::string list = "[";
  for (const auto& alarm : alarms.standing()) list += (list.size() > 1 ? "," : "") + alarm_json(alarm);
  hub.publish(Topic::alarms, list + ']', now.us());
}

Application::Application(Deps deps) : state_(std::make_unique<State>(std::move(deps))) {}
Application::~Application() { stop(); }

void Application::State::sign_models_of_before() {
  auto& store = stores.models;
  std::set<ModelId> promoted;
  if (const auto all = store.promotions("", 100'000)) {
    for (const auto& one : all.value())
      if (one.model) promoted.insert(*one.model);
  }
  std::optional<ModelId> after;
  std::size_t n = 0;
  while (true) {
    const auto page = store.models(100, after);
    if (!page || page.value().empty()) break;
    for (const auto& model : page.value()) {
      after = model.id;
      if (!model.signature.empty() || (!model.run && !promoted.contains(model.id))) continue;
      const auto text = store.artifact(model.id);
      if (!text) continue;
      const auto purpose = model.run ? ModelStanding::made : ModelStanding::vouched;
      if (store.sign(model.id, signer.sign(purpose, text.value()))) ++n;
    }
  }
  if (n > 0)
    events.add(
        EventLevel::info, "model.signed",
        std::to_string(n) + " models of before are signed with this server's new key " + signer.key_id());
}

Router& Application::router() { return state_->router; }
Hub& Application::hub() { return state_->hub; }
DeviceRows& Application::device_rows() { return state_->device_ingest; }

std::optional<Response> Application::at_hand(const Route& route, const Request& request) const {
  if (route.pattern != k_anchor_pattern) return std::nullopt;
  return state_->anchor_answers.find(request);
}

WsHandlerFactory Application::ws_factory() {
  return [this](const Principal& who, std::function<bool()> holds) {
    return std::make_unique<Conversation>(state_->hub, who, std::move(holds));
  };
}

TokenWsFactory Application::omlox_ws_factory() {
  return [this](std::function<bool()> holds, TokenDoor door) {
    return std::make_unique<OmloxConversation>(state_->hub, state_->omlox_locations, std::move(holds),
                                               std::move(door));
  };
}

void Application::start() {
  if (std::exchange(state_->started, true)) return;
  // Whatever is kept, the server starts: what cannot be taken up again is told.
  (void)guarded("models and events at the start", [this] {
    if (state_->deps.model_key_is_new) state_->sign_models_of_before();
    const auto loaded = state_->models.reload();
    if (const auto& fault = state_->models.active()->fault; !fault.empty())
      state_->events.add(EventLevel::warning, "model.refused", fault);
    if (!loaded) state_->deps.log_fault("", loaded.error().message);
    const auto before = promotion_events(state_->stores.models, state_->stores.missions);
    if (before)
      state_->events.restore(before.value());
    else
      state_->deps.log_fault("", before.error().message);
  });
  (void)guarded("missions at the start", [this] { state_->missions.resume(); });
  (void)guarded("devices of the flight at the start", [this] { state_->stream.resume(); });
  (void)guarded("webhooks at the start", [this] { state_->webhooks.changed(); });
  if (state_->deps.broker != nullptr) state_->deps.broker->start(state_->publisher);
  state_->flights.start();
  state_->jobs.start();
  state_->housekeeping.start();
  state_->heart = Thread("anchord-beat", [this] { state_->beat(); });
}

void Application::stream_round() { state_->hub.tick(); }

void Application::fly() { state_->flights.step(); }

void Application::housekeeping_round() { state_->housekeeping.round(); }

void Application::stop() {
  if (state_->stopping.exchange(true)) return;
  state_->stop_told.notify_all();
  if (state_->heart.joinable()) state_->heart.join();
  if (state_->deps.broker != nullptr) state_->deps.broker->stop();
  state_->housekeeping.stop();
  state_->demonstration.stop();
  state_->flights.stop();
  state_->hub.shut_down();
  state_->jobs.stop();
  state_->missions.stop();
  state_->webhooks.stop();
  state_->late.stop();
}

}  // namespace anchord::api
