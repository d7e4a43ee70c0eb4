#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "api/learning/model_gate.hpp"
#include "api/learning/model_registry.hpp"
#include "core/ports/job_store.hpp"
#include "core/ports/learning_store.hpp"

namespace anchord::api {

nlohmann::ordered_json campaign_json(const CampaignRecord& campaign,
                                     const std::vector<CampaignStore::Setting>* settings);
/// Applies a whole body (POST) or a merge-patch to `campaign`.
void patch_campaign(const nlohmann::json& body, bool whole, CampaignRecord& campaign,
                    std::vector<FieldError>& errors);
nlohmann::ordered_json sample_json(const CampaignStore::StoredSample& sample);
/// {"rx_dbm": -80.1, ...}: those that are present, by name.
nlohmann::ordered_json features_json(const nlos::FeatureVector& features);

nlohmann::ordered_json dataset_json(const DatasetRecord& dataset, bool whole);
nlohmann::ordered_json training_run_json(const TrainingRun& run, const DatasetRecord& dataset, const Job& job,
                                         bool whole);
nlohmann::ordered_json model_json(const StoredModel& model, bool active);
nlohmann::ordered_json promotion_json(const Promotion& promotion);
nlohmann::ordered_json gate_json(const GateReport& gate);
/// Ids by task, of those that spoke.
nlohmann::ordered_json range_models_json(const RangeModels& models);
nlohmann::ordered_json model_answer_json(const ModelAnswer& judgement);

/// One sample to predict: diagnostics and features by name. What is wrong goes to `errors`.
nlos::FeatureVector read_features(const nlohmann::json& sample, const std::string& at,
                                  std::vector<FieldError>& errors);

}  // namespace anchord::api
