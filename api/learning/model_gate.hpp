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
  std::string name;  ///< single_ranges, evaluated, same_rows, fpr, accuracy, mae_m, helps
  std::optional<double> candidate{}, current{};
  bool passed{true};
  std::string basis;  ///< held_out: the places its own run held out; kept_data: places this server keeps;
                      ///< manifest: cross-validation of models made here, on the same rows and folds; none
};

struct GateReport {
  bool passed{true};
  std::vector<GateCheck> checks;
  std::string why;       ///< what did not pass, in words
  std::string standing;  ///< of the candidate: made, vouched, foreign
};

/// Rows a model may be judged by: the test part of `table`, single ranges only, for that is what it will
/// meet.
struct GateRows {
  const DatasetTable* table{nullptr};
  std::string basis{};       ///< of the checks made on it
  std::size_t least_rows{};  ///< fewer tell nothing
};

/// Rows of data that are no part of the model's own run.
inline constexpr std::size_t k_least_kept_rows = 10;

/// What a model may be judged by.
struct GateData {
  std::vector<GateRows> rows{};  ///< the first that can judge both models does
  bool believe_manifest{true};   ///< where none can; never of a model from elsewhere
};

/// A model takes over by default only where it does not worsen what it replaces: FPR of an identification,
/// MAE of a correction; and it must help at all: a correction beside none, a class beside always saying the
/// same. Both are measured on the same rows, those that have the features of both; two that were never
/// measured on the same rows fail. What a manifest claims counts only of models made here: one from
/// elsewhere that no kept row can judge fails. So does one that was not trained on single ranges. Only a
/// person's reason lets a model pass that fails.
GateReport gate_of(const ml::Model& candidate, const ml::Model* current, const GateData& data);

}  // namespace anchord::api
