#include "api/application_state.hpp"

#include <nlohmann/json.hpp>

#include "api/anchors/published_features.hpp"
#include "api/bundles/bundle_notes.hpp"
#include "api/calibration/revision_news.hpp"
#include "api/devices/device_json.hpp"
#include "api/exchange/anchor_files.hpp"
#include "api/flight/kept_outcome.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/mqtt/mqtt_status.hpp"
#include "core/base/ed25519.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/backups.hpp"
#include "core/ports/broker.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/drone.hpp"
#include "core/ports/plan_store.hpp"

namespace anchord::api {

Application::State::State(Deps d)
    : deps(std::move(d)),
      stores(deps.stores),
      scoped(stores, deps.access.organizations()),
      seen(scoped.stores()),
      steady(*deps.steady),
      late([this](std::string_view what) { deps.log_fault("", what); }),
      prompt(stores.access, late),
      flight_events(stores.events, late),
      running(stores.service, steady),
      router(
          stores.access, [this] { return running.now_ns(); }, prompt),
      hub(deps.clock, "anchord " + deps.build.version + (deps.build.git.empty() ? "" : "+" + deps.build.git)),
      events(hub, deps.clock),
      alarms(events),
      signer(ModelSigner::parse_seed(deps.model_key).value()),
      models(ModelSource(stores.models, signer)),
      missions(
          {.missions = seen.missions,
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
           .models_promoted = [this] { return !models.active()->predictor.empty(); },
           .site_outline = deps.site_outline,
           .track = deps.track,
           .kept_priors = [this](const MissionId& id) { return kept_outcome(stores.plans, id).priors; },
           .kept_targets = [this](const MissionId& id) { return kept_outcome(stores.plans, id).targets; }}),
      structures(stores.places),
      flights({.missions = missions,
               .plans = seen.plans,
               .procedure_log = stores.procedure_log,
               .structures = structures,
               .hub = hub,
               .events = events,
               .clock = deps.clock,
               .steady = steady,
               .plan = deps.work.plan,
               .late = late,
               .drone = deps.drone,
               .storage = deps.storage_status,
               .ended = [this](const std::string& token_id) { return deps.access.ended(token_id); },
               .now_s = deps.flight_clock}),
      stream({deps.devices, stores.service, stores.missions, events}),
      cir_retention({deps.cir_archive, deps.keep_cir_days, events, stores.access, deps.clock, steady,
                     [this] { return missions.recording(); }, deps.storage_status}),
      housekeeping({stores.bin, running, events, [this] { return router.purge_answers(); }, cir_retention,
                    deps.keep_deleted_ns, deps.housekeeping_by_hand}),
      ingest(stores.measurements, missions),
      device_ingest(stores.measurements, missions),
      demonstration({missions, device_ingest, events, deps.clock, deps.demonstration}),
      jobs(stores.jobs, hub, deps.clock, deps.work.jobs),
      desk(make_desk()),
      geo(deps.geoid_dir),
      contradictions({stores.anchors, stores.calibrations, stores.revisions, stores.missions, events}),
      profiles(stores.kits, stores.missions, deps.clock),
      calibrations(
          {.measurements = seen.measurements,
           .missions = seen.missions,
           .sites = seen.sites,
           .calibrations = seen.calibrations,
           .jobs = jobs,
           .job_store = stores.jobs,
           .clock = deps.clock,
           .profiles = profiles,
           .models = models,
           .flight_priors = [this](const MissionId& id) { return kept_outcome(stores.plans, id).priors; },
           .frames = seen.frames,
           .exclusions = stores.exclusions,
           .track = deps.track,
           .contradictions = contradictions,
           .desk = desk.get()}),
      training({stores.datasets, stores.training_runs, jobs, events, deps.clock, deps.run_work,
                deps.build.version, signer, desk.get()}),
      omlox_locations(hub, seen.missions),
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
                cir_retention,
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
      organization_api{seen.organizations, deps.clock, audit},
      device_api{deps.devices, seen.measurements, stream, jobs, audit},
      mission_api{
          missions,      seen.missions, seen.measurements, seen.sites,           seen.bin,   stream, events,
          flight_events, housekeeping,  running,           deps.keep_deleted_ns, deps.clock, audit,  flights},
      measurement_api{seen.measurements, ingest, missions,     models, stores.exclusions, events,
                      deps.clock,        audit,  demonstration},
      anchor_answers(stores.revisions, contradictions),
      anchor_api{seen.sites,     seen.organizations, seen.anchors, seen.calibrations,
                 seen.revisions, seen.frames,        missions,     geo,
                 contradictions, deps.clock,         audit},
      calibration_api{calibrations,
                      seen.calibrations,
                      seen.revisions,
                      seen.sites,
                      seen.anchors,
                      seen.missions,
                      stores.exclusions,
                      missions,
                      contradictions,
                      profiles,
                      jobs,
                      hub,
                      events,
                      deps.clock,
                      audit,
                      "anchord " + deps.build.version},
      planning_api{seen.plans,
                   seen.sites,
                   deps.clock,
                   audit,
                   [this](const PlanId& id) { return flights.flown_with(id); },
                   [this](const Plan& plan) { flights.plan_saved(plan); },
                   structures},
      flight_api{flights, mission_api, stores.procedure_log, events, audit},
      publisher({hub, stores.missions, stores.sites, stores.revisions,
                 [this] {
                   std::uint64_t newest = 0;
                   return published_features(anchor_api, std::nullopt, newest);
                 },
                 steady, deps.mqtt_prefix, deps.build.version}),
      exchange_api{anchor_api, seen.missions, seen.measurements, seen.places, deps.geopackage},
      webhook_api{stores.webhooks, webhooks, deps.web_post, deps.clock, audit},
      omlox_api{anchor_api, seen.places, omlox_locations, deps.clock},
      place_api{seen.places, seen.sites, jobs,  deps.run_plan_work,
                deps.clock,  steady,     audit, [this] { structures.changed(); }},
      bundle_api{.bundles = seen.bundles,
                 .events = stores.events,
                 .missions = seen.missions,
                 .sites = seen.sites,
                 .clock = deps.clock,
                 .audit = audit,
                 .made_by = "anchord " + deps.build.version,
                 .spool = deps.spool_dir,
                 .named = [this](const Request& request) { return named_mission(mission_api, request); },
                 .notes =
                     [this](const Mission& mission, const Principal& who) {
                       return bundle_notes(flight_events, stores.access, mission, who);
                     },
                 .taken = [this](const MissionId& id, const std::string& text,
                                 bool published) { announce_bundle(calibration_api, id, text, published); },
                 .calibrations = seen.calibrations,
                 .revisions = seen.revisions,
                 .key = signer.key(),
                 .ask = [this](Request& request) { return router.handle(request); },
                 .measurements = seen.measurements,
                 .feature_file = deps.feature_file,
                 .print_pdf = deps.print_pdf},
      learning_stores{stores.campaigns, stores.labels, stores.datasets, stores.training_runs, stores.models},
      learning_api{
          learning_stores,
          training,
          models,
          seen.measurements,
          seen.missions,
          stores.exclusions,
          jobs,
          stores.jobs,
          events,
          [this](const std::string& code, const std::string& text) { missions.note_in_flights(code, text); },
          deps.clock,
          audit} {
  missions.observe(&flights);
  mission_api.flight = flight_actions(flight_api);
  mission_api.flight_time = [this](const MissionId& id) { return flown_time_json(flights.flown_time(id)); };
  anchor_api.goals = {deps.goal, [this](const MissionId& id) { return flights.targets(id); }};
  calibration_api.goals = anchor_api.goals;
  anchor_api.answers = &anchor_answers;
  anchor_api.file = [this](std::string_view format, const Request& request) {
    return anchor_file(exchange_api, format, request);
  };
  add_routes();
  events.on_event([this](const LiveEvent& event) {
    flight_events.keep(event);
    webhooks.notify(event);
  });
}

std::unique_ptr<WorkDesk> Application::State::make_desk() {
  if (deps.work_store == nullptr) return nullptr;
  return std::make_unique<WorkDesk>(
      WorkDesk::Deps{.work = *deps.work_store,
                     .job_store = stores.jobs,
                     .jobs = jobs,
                     .events = events,
                     .clock = deps.clock,
                     .on = deps.work.jobs,
                     .run = deps.run_work,
                     .options = {deps.build.version, deps.worker_name, deps.run_jobs_here, deps.job_lease}});
}

void Application::State::add_routes() {
  router.on_fault(deps.log_fault);
  router.run_bound_by(
      [this](const Route& route, const Request& request) { return run_bound(route, request); });
  add_mission_routes(router, mission_api);
  add_mission_bin_routes(router, mission_api);
  add_mission_correct_routes(router, mission_api);
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
  add_access_routes(router, deps.access, stores.sites, stores.organizations);
  add_organization_routes(router, organization_api);
  add_alarm_routes(router, admin_api);
  add_backup_routes(router, admin_api);
  add_cir_archive_routes(router, admin_api);
  add_system_routes(router, admin_api);
  add_ogc_routes(router, exchange_api);
  add_anchor_file_routes(router, exchange_api);
  add_webhook_routes(router, webhook_api);
  add_omlox_routes(router, omlox_api);
  add_building_routes(router, place_api);
  add_floor_routes(router, place_api);
  add_floor_plan_routes(router, place_api);
  add_bundle_routes(router, bundle_api);
  add_upload_routes(router, bundle_api);
  add_handover_routes(router, bundle_api);
}

ServerCounts Application::State::counts() const {
  const auto& lines = ingest.counters();
  return {missions.recording(), missions.queued(), missions.followed(), missions.evicted(),
          lines.accepted,       lines.duplicates,  lines.rejected};
}

nlohmann::ordered_json Application::State::device_clock() const { return clock_json(deps.devices.clock()); }

nlohmann::ordered_json Application::State::drone() const {
  return deps.drone == nullptr ? nlohmann::ordered_json(nullptr) : drone_json(deps.drone->status());
}

nlohmann::ordered_json Application::State::mqtt() const {
  return deps.broker == nullptr ? nlohmann::ordered_json(nullptr) : broker_json(deps.broker->status());
}

/// Rows of topic `devices` for what is set up here.
std::string Application::State::device_rows() {
  std::string out;
  for (const auto& device : deps.devices.devices()) {
    out += (out.empty() ? "" : ",") + to_wire(device_row_json(device));
  }
  return out;
}

}  // namespace anchord::api
