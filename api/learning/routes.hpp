#pragma once

#include <functional>
#include <string>

#include "api/kit/audit.hpp"
#include "api/learning/learning_stores.hpp"
#include "api/learning/model_registry.hpp"
#include "api/learning/training_service.hpp"

namespace anchord {
class ExclusionStore;
class JobStore;
class MeasurementStore;
class MissionStore;
struct DatasetRecord;
}  // namespace anchord

namespace anchord::api {

class EventLog;
class JobService;
class Router;

/// What the routes of learning work with; lives as long as the router.
struct LearningApi {
  LearningStores& stores;
  TrainingService& training;
  ModelRegistry& models;
  MeasurementStore& measurements;
  MissionStore& missions;
  ExclusionStore& exclusions;
  JobService& jobs;
  JobStore& job_store;
  EventLog& events;
  /// An event in the record of every flight that records now.
  std::function<void(const std::string& code, const std::string& text)> note_in_flights;
  const Clock& clock;
  Audit audit;
};

void add_campaign_routes(Router& router, LearningApi& api);
void add_dataset_routes(Router& router, LearningApi& api);
void add_training_run_routes(Router& router, LearningApi& api);
void add_model_routes(Router& router, LearningApi& api);

/// A data set by id, or by its name.
DatasetRecord find_dataset(LearningStores& stores, const std::string& text);

}  // namespace anchord::api
