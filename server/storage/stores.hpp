#pragma once

#include <functional>
#include <memory>

#include "core/ports/exclusion_store.hpp"
#include "core/ports/learning_store.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/plan_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/ports/store.hpp"
#include "server/storage/sql.hpp"

/// The ports, written once for every database behind a Gate.
namespace anchord::sql {

/// Empty, or why a new mission cannot be taken now (space).
using AdmitMission = std::function<std::optional<Error>()>;

std::unique_ptr<MeasurementStore> make_measurement_store(Gate& gate);
std::unique_ptr<MissionStore> make_mission_store(Gate& gate, AdmitMission admit);
std::unique_ptr<AnchorStore> make_anchor_store(Gate& gate);
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
std::unique_ptr<MissionBin> make_mission_bin(Gate& gate);
std::unique_ptr<ServiceStore> make_service_store(Gate& gate);
std::unique_ptr<ExclusionStore> make_exclusion_store(Gate& gate);

/// The short form of a mission's id; nothing when there is no such mission, or when it is in the bin.
std::optional<std::int64_t> mission_key(Connection& connection, const MissionId& id);
/// What is in the bin, last deleted first.
std::vector<BinnedMission> read_binned_missions(Connection& connection);

/// SQL's LIMIT of a page size that comes from outside.
std::int64_t row_limit(std::size_t limit);

}  // namespace anchord::sql
