#pragma once

#include <map>
#include <string>

#include "api/learning/dataset_table.hpp"
#include "core/ml/training.hpp"

namespace anchord::api {

/// What a finished training run answers, as JSON texts: "summary" for the run itself, and what its
/// sub-resources give: folds, grid, importance, selection, confusion, roc, cdf, predictions, split.
std::map<std::string, std::string> training_parts(const ml::TrainingOutcome& outcome,
                                                  const DatasetTable& table, const LearningRows& rows);

}  // namespace anchord::api
