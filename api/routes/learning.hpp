#pragma once

#include "api/learning/model_registry.hpp"
#include "api/learning/training_service.hpp"
#include "api/routes/routes.hpp"

namespace anchord::api {

/// What the routes of learning work with, beside the common services.
struct LearningServices {
  Services& services;
  LearningStores& stores;
  TrainingService& training;
  ModelRegistry& models;
};

void add_campaign_routes(Router& router, LearningServices& learning);
void add_dataset_routes(Router& router, LearningServices& learning);
void add_training_run_routes(Router& router, LearningServices& learning);
void add_model_routes(Router& router, LearningServices& learning);

/// A data set by id, or by its name.
DatasetRecord find_dataset(LearningStores& stores, const std::string& text);

}  // namespace anchord::api
