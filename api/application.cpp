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
#include "api/anchors/contradiction_watch.hpp"
#include "api/anchors/geo_service.hpp"
#include "api/anchors/routes.hpp"
#include "api/calibration/calibration_service.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/calibration/routes.hpp"
#include "api/devices/device_json.hpp"
#include "api/devices/device_stream.hpp"
#include "api/devices/routes.hpp"
#include "api/flight/flight_service.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/flight/routes.hpp"
#include "api/kit/late_writer.hpp"
#include "api/learning/promotion_events.hpp"
#include "api/learning/routes.hpp"
#include "api/measurements/device_ingest.hpp"
#include "api/measurements/ingest.hpp"
#include "api/measurements/routes.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/routes.hpp"
#include "api/planning/routes.hpp"
#include "api/stream/conversation.hpp"
#include "api/stream/hub.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/backups.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/drone.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {
namespace {

/// An alarm about a failed task stands so long after the newest failure.
constexpr auto k_failure_stands = std::chrono::minutes(5);

}  // namespace

struct Application::State {
  explicit State(Deps d)
      : deps(std::move(d)),
        late([this](std::string_view what) {
          if (deps.log_fault) deps.log_fault("", what);
        }),
        prompt(deps.access_store, late),
        steady(deps.steady != nullptr ? *deps.steady : system_steady_clock()),
        running(deps.service, steady),
        router(
            &deps.access_store, [this] { return running.now_ns(); }, &prompt),
        hub(deps.clock, "anchord " + deps.build.version),
        events(hub, deps.clock),
        alarms(events),
        signer(signer_of(deps)),
        models(deps.learning != nullptr
                   ? std::make_unique<ModelRegistry>(ModelSource(deps.learning->models, signer.get()))
                   : nullptr),
        missions({deps.missions, deps.measurements, deps.anchors, hub, events, deps.clock, deps.post,
                  deps.goal, [this] { return device_rows(); }, judge(), needs_cir(), deps.site_outline,
                  &steady, deps.exclusions, deps.track, &late,
                  [this](const MissionId& id) { return clues_of_flight(id); }}),
        stream({deps.devices, deps.service, deps.missions, events}),
        housekeeping({deps.bin, running, events, [this] { return router.purge_answers(); },
                      deps.keep_deleted_ns, deps.housekeeping_by_hand}),
        ingest(deps.measurements, missions),
        device_ingest(deps.measurements, missions),
        jobs(deps.jobs, hub, deps.clock),
        geo(deps.geoid_dir),
        contradictions({deps.anchors, deps.missions, events}),
        calibrations({deps.measurements, deps.missions, deps.anchors, jobs, deps.clock, profiles_of(deps),
                      models.get(), [this](const MissionId& id) { return clues_of_flight(id); }, deps.frames,
                      deps.exclusions, deps.track, &contradictions}),
        audit(deps.access_store, prompt, deps.clock),
        admin_api{deps.clock,
                  hub,
                  events,
                  alarms,
                  jobs,
                  deps.jobs,
                  prompt,
                  audit,
                  deps.build,
                  deps.backups,
                  [this] { return storage_status(); },
                  [this] { return counts(); },
                  [this] { return device_clock(); },
                  [this] { return drone(); },
                  [this] { return metrics_text(); }},
        device_api{deps.devices, deps.measurements, stream, jobs, audit},
        mission_api{missions,
                    deps.missions,
                    deps.measurements,
                    deps.anchors,
                    deps.bin,
                    deps.devices,
                    stream,
                    events,
                    housekeeping,
                    running,
                    deps.keep_deleted_ns,
                    deps.clock,
                    audit},
        measurement_api{deps.measurements, ingest, missions,   models.get(),
                        deps.exclusions,   events, deps.clock, audit},
        anchor_api{deps.anchors, deps.frames, missions, geo, contradictions, deps.clock, audit},
        calibration_api{calibrations,   deps.anchors,   deps.missions, missions,
                        contradictions, profiles.get(), jobs,          hub,
                        events,         deps.clock,     audit,         "anchord " + deps.build.version} {
    router.on_fault(deps.log_fault);
    add_mission_routes(router, mission_api);
    add_mission_bin_routes(router, mission_api);
    add_measurement_routes(router, measurement_api);
    add_site_routes(router, anchor_api);
    add_anchor_routes(router, anchor_api);
    add_calibration_routes(router, calibration_api);
    add_comparison_routes(router, calibration_api);
    if (profiles) add_kit_routes(router, calibration_api);
    if (deps.frames != nullptr) add_frame_routes(router, anchor_api);
    if (deps.exclusions != nullptr) add_exclusion_routes(router, measurement_api);
    add_device_routes(router, device_api);
    add_job_routes(router, admin_api);
    if (deps.plans != nullptr) add_flights(*deps.plans);
    if (deps.learning != nullptr) {
      learning = std::make_unique<Learning>(*this);
      add_campaign_routes(router, learning->api);
      add_dataset_routes(router, learning->api);
      add_training_run_routes(router, learning->api);
      add_model_routes(router, learning->api);
    }
    if (deps.access != nullptr) add_access_routes(router, *deps.access);
    add_alarm_routes(router, admin_api);
    if (deps.backups != nullptr) add_backup_routes(router, admin_api);
    add_system_routes(router, admin_api);
  }

  void add_flights(PlanStore& plans) {
    flights = std::make_unique<FlightService>(
        FlightService::Deps{missions, plans, hub, events, deps.clock, deps.drone,
                            [this] { return storage_status(); }, deps.flight_clock, &steady, &late});
    missions.observe(flights.get());
    planning_api.emplace(PlanningApi{plans, deps.anchors, deps.clock, audit,
                                     [this](const PlanId& id) { return flights->flown_with(id); }});
    add_plan_routes(router, *planning_api);
    flight_api.emplace(FlightApi{*flights, mission_api, events, audit});
    mission_api.control = flights.get();
    mission_api.flight = flight_actions(*flight_api);
    add_flight_routes(router, *flight_api);
  }

  StorageStatus storage_status() const {
    return deps.storage_status ? deps.storage_status() : StorageStatus{};
  }
  ServerCounts counts() const {
    const auto& lines = ingest.counters();
    return {missions.recording(), missions.queued(), missions.followed(), missions.evicted(),
            lines.accepted,       lines.duplicates,  lines.rejected};
  }
  nlohmann::ordered_json device_clock() const {
    return deps.devices == nullptr ? nlohmann::ordered_json(nullptr) : clock_json(deps.devices->clock());
  }
  nlohmann::ordered_json drone() const {
    return deps.drone == nullptr ? nlohmann::ordered_json(nullptr) : drone_json(deps.drone->status());
  }
  std::string metrics_text() const {
    return (flights ? flights->metrics() : std::string()) + (deps.metrics_text ? deps.metrics_text() : "");
  }

  static std::unique_ptr<ModelSigner> signer_of(const Deps& from) {
    if (from.model_key.empty()) return nullptr;
    return std::make_unique<ModelSigner>(ModelSigner::parse_seed(from.model_key).value());
  }
  /// Once, when the key is new: what a run made here, and what was promoted before promotions judged uploads.
  void sign_models_of_before();

  KitProfiles* profiles_of(const Deps& from) {
    if (from.kits != nullptr) profiles = std::make_unique<KitProfiles>(*from.kits, from.missions, from.clock);
    return profiles.get();
  }

  /// What turns and height searches of a mission's flight told, as kept with it.
  procedure::FlightClues clues_of_flight(const MissionId& id) const {
    const auto kept = deps.plans != nullptr ? deps.plans->procedures()
                                            : make_error(Errc::not_found, "no plans are kept here");
    if (!kept) return {};
    for (const auto& [mission, text] : kept.value()) {
      const auto j = nlohmann::json::parse(text, nullptr, false);
      if (mission == id && j.is_object()) return clues_of(j.value("clues", nlohmann::json()));
    }
    return {};
  }

  /// What the promoted models say of a range as it comes. Nothing while none is promoted.
  std::function<std::optional<RangeModel>(const Range&)> judge() const {
    if (!models) return {};
    return [registry = models.get()](const Range& range) { return judge_range(*registry->active(), range); };
  }
  std::function<bool()> needs_cir() const {
    if (!models) return {};
    return [registry = models.get()] { return registry->active()->needs_cir; };
  }

  void beat();
  std::string device_rows();
  void second();
  void background_round();
  void tell_system(UtcTime now, ServerPulse& pulse);
  void tell_alarms(UtcTime now, std::vector<AlarmCondition> holding,
                   std::vector<std::pair<std::string_view, std::string>>& of_flight);

  Deps deps;
  LateWriter late;
  PromptAccessStore prompt;
  const SteadyClock& steady;
  RunningTime running;
  Router router;
  Hub hub;
  EventLog events;
  AlarmBoard alarms;
  std::unique_ptr<ModelSigner> signer;
  std::unique_ptr<ModelRegistry> models;
  MissionService missions;
  DeviceStream stream;
  Housekeeping housekeeping;
  ClockWatch clock_watch;
  IngestService ingest;
  DeviceIngest device_ingest;
  JobService jobs;
  GeoService geo;
  ContradictionWatch contradictions;
  std::unique_ptr<KitProfiles> profiles;
  std::unique_ptr<FlightService> flights;
  CalibrationService calibrations;
  Audit audit;
  AdminApi admin_api;
  DeviceApi device_api;
  MissionApi mission_api;
  MeasurementApi measurement_api;
  AnchorApi anchor_api;
  CalibrationApi calibration_api;
  std::optional<PlanningApi> planning_api;
  std::optional<FlightApi> flight_api;
  struct Learning {
    explicit Learning(State& s)
        : training({s.deps.learning->datasets, s.deps.learning->runs, s.jobs, s.events, s.deps.clock,
                    s.deps.run_work ? s.deps.run_work : RunWork(work_inline), s.deps.build.version,
                    s.signer.get()}),
          api{*s.deps.learning,
              training,
              *s.models,
              s.deps.measurements,
              s.deps.missions,
              s.deps.exclusions,
              s.jobs,
              s.deps.jobs,
              s.events,
              [&s](const std::string& code, const std::string& text) {
                s.missions.note_in_flights(code, text);
              },
              s.deps.clock,
              s.audit} {}
    TrainingService training;
    LearningApi api;
  };
  std::unique_ptr<Learning> learning;
  Locked<bool> stopping{false};
  std::condition_variable stop_told;
  bool started{false};
  Thread heart;
};

/// Rows of topic `devices` for what is set up here.
std::string Application::State::device_rows() {
  std::string out;
  if (deps.devices == nullptr) return out;
  for (const auto& device : deps.devices->devices()) {
    out += (out.empty() ? "" : ",") + to_wire(device_row_json(device));
  }
  return out;
}

/// 50 ms: what was collected goes out, mission states each half second, the rest each second.
void Application::State::beat() {
  for (std::uint64_t n = 1;; ++n) {
    {
      auto stop = stopping.lock();
      if (stop.wait_for(stop_told, std::chrono::milliseconds(50), [](bool told) { return told; })) return;
    }
    (void)guarded("live stream", [this] { hub.tick(); });
    if (n % 10 == 0) (void)guarded("mission states", [this] { missions.tick(); });
    if (n % 20 == 0) second();
  }
}

/// About once a second, on the thread of late writes; each part behind a guard of its own.
void Application::State::background_round() {
  (void)guarded("contradicted anchors", [this] { (void)contradictions.standing(); });
  (void)guarded("last uses of tokens", [this] {
    if (deps.access != nullptr) deps.access->flush();
  });
  (void)guarded("scheduled backup", [this] {
    // Daily and after every flight (reliability.md section 2).
    if (deps.backups == nullptr || !deps.backups->due(missions.finished())) return;
    if (const auto begun = begin_backup(admin_api); !begun)
      events.add("warning", "backup.failed", begun.error().message);
  });
}

/// Each part behind the guard of its own: what fails in one must not keep the alarm about it from the page.
void Application::State::second() {
  const UtcTime now = deps.clock.now();
  ServerPulse pulse;
  // Alarms and heartbeats must not wait for the disk.
  late.idle_task([this] { background_round(); });
  (void)guarded("server status", [&] { tell_system(now, pulse); });
  (void)guarded("device clocks", [&] {
    if (deps.devices == nullptr) return;
    pulse.clock_skew = deps.devices->clock().skew;
    pulse.unrecorded = deps.devices->recorder_failure();
    pulse.not_started = deps.devices->not_started();
  });
  std::vector<FlightPulse> pulses;
  (void)guarded("mission states", [&] { pulses = missions.pulses(); });
  std::vector<std::pair<std::string_view, std::string>> of_flight;
  (void)guarded("flight alarms", [&] {
    if (flights) of_flight = flights->alarms();
  });
  for (const auto& failure : task_failures(k_failure_stands)) {
    pulse.failed_tasks +=
        (pulse.failed_tasks.empty() ? "" : "; ") + failure.task + " (" + to_utf8(failure.what, 120) + ')';
  }
  (void)guarded("alarms", [&] { tell_alarms(now, alarm_conditions(pulses, pulse), of_flight); });
}

void Application::State::tell_system(UtcTime now, ServerPulse& pulse) {
  const StorageStatus storage = storage_status();
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

void Application::State::tell_alarms(UtcTime now, std::vector<AlarmCondition> holding,
                                     std::vector<std::pair<std::string_view, std::string>>& of_flight) {
  for (auto& [id, text] : of_flight) {
    const bool told = std::any_of(holding.begin(), holding.end(), [&](const auto& c) { return c.id == id; });
    if (!text.empty() && !told)
      holding.push_back({std::string(id), AlarmPriority::critical, std::move(text), std::nullopt});
  }
  if (auto step = clock_watch.look(now, steady.now()); !step.empty())
    holding.push_back({"clock.step", AlarmPriority::warning, std::move(step), std::nullopt});
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
  auto& store = deps.learning->models;
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
      if (store.sign(model.id, signer->sign(purpose, text.value()))) ++n;
    }
  }
  if (n > 0)
    events.add(
        "info", "model.signed",
        std::to_string(n) + " models of before are signed with this server's new key " + signer->key_id());
}

Router& Application::router() { return state_->router; }
Hub& Application::hub() { return state_->hub; }
DeviceRows& Application::device_rows() { return state_->device_ingest; }

WsHandlerFactory Application::ws_factory() {
  return [this](const Principal& who, std::function<bool()> holds) {
    return std::make_unique<Conversation>(state_->hub, who, std::move(holds));
  };
}

void Application::start() {
  if (std::exchange(state_->started, true)) return;
  // Whatever is kept, the server starts: what cannot be taken up again is told.
  (void)guarded("models and events at the start", [this] {
    if (!state_->models) return;
    if (state_->signer && state_->deps.model_key_is_new) state_->sign_models_of_before();
    const auto loaded = state_->models->reload();
    if (const auto& fault = state_->models->active()->fault; !fault.empty())
      state_->events.add("warning", "model.refused", fault);
    if (!loaded && state_->deps.log_fault) state_->deps.log_fault("", loaded.error().message);
    const auto before = promotion_events(state_->deps.learning->models, state_->deps.missions);
    if (before)
      state_->events.restore(before.value());
    else if (state_->deps.log_fault)
      state_->deps.log_fault("", before.error().message);
  });
  (void)guarded("missions at the start", [this] { state_->missions.resume(); });
  (void)guarded("devices of the flight at the start", [this] { state_->stream.resume(); });
  if (state_->flights) state_->flights->start();
  state_->jobs.start();
  state_->housekeeping.start();
  state_->heart = Thread("anchord-beat", [this] { state_->beat(); });
}

void Application::fly() {
  if (state_->flights) state_->flights->step();
}

void Application::housekeeping_round() { state_->housekeeping.round(); }

void Application::stop() {
  if (state_->stopping.exchange(true)) return;
  state_->stop_told.notify_all();
  if (state_->heart.joinable()) state_->heart.join();
  state_->housekeeping.stop();
  if (state_->flights) state_->flights->stop();
  state_->hub.shut_down();
  state_->jobs.stop();
  state_->missions.stop();
  state_->late.stop();
}

}  // namespace anchord::api
