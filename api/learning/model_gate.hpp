#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/learning/dataset_table.hpp"
#include "core/ml/model.hpp"

namespace anchord::api {

/// One comparison before a promotion.
struct GateCheck {
  std::string name;  ///< fpr, accuracy, mae_m, helps
  std::optional<double> candidate{}, current{};
  bool passed{true};
  std::string basis;  ///< held_out: both on the same places of its own run; kept_data: both on places this
                      ///< server keeps; manifest: each on its own cross-validation, of models made here; none
};

struct GateReport {
  bool passed{true};
  std::vector<GateCheck> checks;
  std::string why;       ///< what did not pass, in words
  std::string standing;  ///< of the candidate: made, vouched, foreign
};

/// What a model may be judged by.
struct GateData {
  const DatasetTable* held_out{nullptr};  ///< whose test part both models are measured on
  std::string basis{"held_out"};          ///< of the checks made on it
  bool believe_manifest{true};            ///< where that says nothing; never of a model from elsewhere
};

/// A model takes over by default only where it does not worsen what it replaces: FPR of an identification,
/// MAE of a correction; and it must help at all: a correction beside none, a class beside always saying the
/// same. Both are measured on the same rows. What a manifest claims counts only of models made here: one from
/// elsewhere that no kept row can judge fails, and only a person's reason lets it pass.
GateReport gate_of(const ml::Model& candidate, const ml::Model* current, const GateData& data);

}  // namespace anchord::api
