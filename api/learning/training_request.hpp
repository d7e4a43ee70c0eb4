#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/problem.hpp"
#include "api/learning/dataset_table.hpp"
#include "core/ml/training.hpp"

namespace anchord::api {

/// Body of POST /training-runs, without its data set.
struct TrainingRequest {
  ml::TrainingSpec spec{};
  Place group_by{Place::environment};
};

/// Reads task, methods, features, cv, grid, select, importance, selection and per_placement; what is wrong
/// goes to `errors`. The key "dataset" is read by the caller.
TrainingRequest read_training_request(const nlohmann::json& body, std::vector<FieldError>& errors);

}  // namespace anchord::api
