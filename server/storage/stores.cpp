#include "server/storage/stores.hpp"

#include <utility>

namespace anchord::sql {

SqlStores::SqlStores(Gate& gate, AdmitMission admit, const CirFolder& files)
    : measurements(make_measurement_store(gate, files)),
      missions(make_mission_store(gate, std::move(admit))),
      bin(make_mission_bin(gate, files)),
      exclusions(make_exclusion_store(gate)),
      events(make_event_store(gate)),
      procedure_log(make_procedure_log(gate)),
      sites(make_site_store(gate)),
      anchors(make_anchor_store(gate)),
      calibrations(make_calibration_store(gate)),
      revisions(make_revision_store(gate)),
      kits(make_kit_store(gate)),
      frames(make_frame_store(gate)),
      plans(make_plan_store(gate)),
      campaigns(make_campaign_store(gate)),
      labels(make_label_store(gate)),
      datasets(make_dataset_store(gate)),
      training_runs(make_training_run_store(gate)),
      models(make_model_store(gate)),
      jobs(make_job_store(gate)),
      tokens(make_token_store(gate)),
      access(make_access_store(gate)),
      service(make_service_store(gate)),
      webhooks(make_webhook_store(gate)),
      places(make_place_store(gate)),
      bundles(make_bundle_store(gate, files)),
      organizations(make_organization_store(gate)),
      cir_archive(make_cir_archive(gate, files, *measurements)),
      ports{*measurements,  *missions,     *bin,  *exclusions, *events, *procedure_log, *sites,    *anchors,
            *calibrations,  *revisions,    *kits, *frames,     *plans,  *campaigns,     *labels,   *datasets,
            *training_runs, *models,       *jobs, *tokens,     *access, *service,       *webhooks, *places,
            *bundles,       *organizations} {}

}  // namespace anchord::sql
