#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "api/learning/dataset_table.hpp"
#include "core/ml/training.hpp"

namespace anchord::api {

/// What a finished training run answers, as JSON texts: "summary" for the run itself, and what its
/// sub-resources give: folds, grid, importance, selection, confusion, roc, cdf, predictions, split.
std::map<std::string, std::string> training_parts(const ml::TrainingOutcome& outcome,
                                                  const DatasetTable& table, const LearningRows& rows);

/// Errors of ranges before and after a correction, and what it improves them by.
nlohmann::ordered_json bias_json(const ml::BiasEvaluation& evaluation);

}  // namespace anchord::api
