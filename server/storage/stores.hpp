#pragma once

#include <functional>
#include <memory>

#include "core/ports/access_store.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/bundle_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/cir_archive.hpp"
#include "core/ports/event_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/kit_store.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/organization_store.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/procedure_log.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/ports/stores.hpp"
#include "core/ports/token_store.hpp"
#include "core/ports/webhook_store.hpp"
#include "server/storage/cir_file.hpp"
#include "server/storage/sql.hpp"

/// The ports, written once for every database behind a Gate.
namespace anchord::sql {

/// Empty, or why a new mission cannot be taken now (space).
using AdmitMission = std::function<std::optional<Error>()>;

std::unique_ptr<MeasurementStore> make_measurement_store(Gate& gate, const CirFolder& files = {});
std::unique_ptr<MissionStore> make_mission_store(Gate& gate, AdmitMission admit);
std::unique_ptr<SiteStore> make_site_store(Gate& gate);
std::unique_ptr<AnchorStore> make_anchor_store(Gate& gate);
std::unique_ptr<CalibrationStore> make_calibration_store(Gate& gate);
std::unique_ptr<RevisionStore> make_revision_store(Gate& gate);
std::unique_ptr<KitStore> make_kit_store(Gate& gate);
std::unique_ptr<FrameStore> make_frame_store(Gate& gate);
std::unique_ptr<TokenStore> make_token_store(Gate& gate);
std::unique_ptr<JobStore> make_job_store(Gate& gate);
std::unique_ptr<AccessStore> make_access_store(Gate& gate);
std::unique_ptr<CampaignStore> make_campaign_store(Gate& gate);
std::unique_ptr<LabelStore> make_label_store(Gate& gate);
std::unique_ptr<DatasetStore> make_dataset_store(Gate& gate);
std::unique_ptr<TrainingRunStore> make_training_run_store(Gate& gate);
std::unique_ptr<ModelStore> make_model_store(Gate& gate);
std::unique_ptr<PlanStore> make_plan_store(Gate& gate);
std::unique_ptr<MissionBin> make_mission_bin(Gate& gate, const CirFolder& files = {});
std::unique_ptr<ServiceStore> make_service_store(Gate& gate);
std::unique_ptr<ExclusionStore> make_exclusion_store(Gate& gate);
std::unique_ptr<EventStore> make_event_store(Gate& gate);
std::unique_ptr<ProcedureLog> make_procedure_log(Gate& gate);
std::unique_ptr<WebhookStore> make_webhook_store(Gate& gate);
std::unique_ptr<PlaceStore> make_place_store(Gate& gate);
std::unique_ptr<OrganizationStore> make_organization_store(Gate& gate);
std::unique_ptr<BundleStore> make_bundle_store(Gate& gate, const CirFolder& files = {});
/// measurements: over the same gate and folder.
std::unique_ptr<CirArchive> make_cir_archive(Gate& gate, const CirFolder& files,
                                             MeasurementStore& measurements);

/// All of them over one gate, which outlives them.
struct SqlStores {
  /// files: of the impulse responses that are no longer in the database.
  SqlStores(Gate& gate, AdmitMission admit, const CirFolder& files);
  const std::unique_ptr<MeasurementStore> measurements;
  const std::unique_ptr<MissionStore> missions;
  const std::unique_ptr<MissionBin> bin;
  const std::unique_ptr<ExclusionStore> exclusions;
  const std::unique_ptr<EventStore> events;
  const std::unique_ptr<ProcedureLog> procedure_log;
  const std::unique_ptr<SiteStore> sites;
  const std::unique_ptr<AnchorStore> anchors;
  const std::unique_ptr<CalibrationStore> calibrations;
  const std::unique_ptr<RevisionStore> revisions;
  const std::unique_ptr<KitStore> kits;
  const std::unique_ptr<FrameStore> frames;
  const std::unique_ptr<PlanStore> plans;
  const std::unique_ptr<CampaignStore> campaigns;
  const std::unique_ptr<LabelStore> labels;
  const std::unique_ptr<DatasetStore> datasets;
  const std::unique_ptr<TrainingRunStore> training_runs;
  const std::unique_ptr<ModelStore> models;
  const std::unique_ptr<JobStore> jobs;
  const std::unique_ptr<TokenStore> tokens;
  const std::unique_ptr<AccessStore> access;
  const std::unique_ptr<ServiceStore> service;
  const std::unique_ptr<WebhookStore> webhooks;
  const std::unique_ptr<PlaceStore> places;
  const std::unique_ptr<BundleStore> bundles;
  const std::unique_ptr<OrganizationStore> organizations;
  const std::unique_ptr<CirArchive> cir_archive;
  const Stores ports;
};

/// The short form of a mission's id; nothing when there is no such mission, or when it is in the bin.
std::optional<std::int64_t> mission_key(Connection& connection, const MissionId& id);
/// What is in the bin, last deleted first.
std::vector<BinnedMission> read_binned_missions(Connection& connection);

/// not_found when a site is named that is not there.
std::optional<Error> missing_site(Connection& connection, const std::optional<SiteId>& site);
std::optional<Error> missing_organization(Connection& connection,
                                          const std::optional<OrganizationId>& organization);

/// SQL's LIMIT of a page size that comes from outside.
std::int64_t row_limit(std::size_t limit);

}  // namespace anchord::sql
