#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/learning/dataset_table.hpp"
#include "core/ml/predictor.hpp"

namespace anchord::api {

/// One comparison before a promotion.
struct GateCheck {
  std::string name;  ///< single_ranges, plausible, evaluated, same_rows, fpr, accuracy, mae_m, helps,
                     ///< cross_validation, sigma,
                     ///< with_corrections, places
  std::optional<double> candidate{}, current{};
  bool passed{true};
  std::string basis;  ///< held_out: the places its own run held out; kept_data: places this server keeps;
                      ///< active_places: those of the active model; training_rows: what it learned from;
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

/// The places of the active model, where the candidate must be no worse either.
struct ActivePlaces {
  bool asked{false};                   ///< there is an active model, and its data are not the candidate's own
  const DatasetTable* table{nullptr};  ///< of its training run; null: not kept on this server
  /// Where it held no place out: its out-of-fold figures may be believed, and the candidate is measured on
  /// the rows they are of.
  bool believe_manifest{false};
};

/// What a model may be judged by.
struct GateData {
  std::vector<GateRows> rows{};      ///< the first that can judge both models does
  bool believe_manifest{true};       ///< where none can; never of a model from elsewhere
  const DatasetTable* own{nullptr};  ///< what the candidate was trained on, where that is kept
  ActivePlaces active{};
  ml::ModelSet beside{};  ///< all that are active: an identification changes what corrections do
  ml::Correction correction{ml::Correction::weighted};
};

/// A model takes over by default only where it does not worsen what it replaces: FPR of an identification,
/// MAE of a correction; and it must help at all: a correction beside none, a class beside always saying the
/// same. Both are measured on the same rows, those that have the features of both; two that were never
/// measured on the same rows fail. One made here must help in its own cross-validation too, so that no easy
/// held-out part hides it; rows that stand in both parts judge nobody. The sigmas that a correction claims
/// must hold: too few errors within them fail. An identification must not make the active corrections worse.
/// It must be no worse on the places of the active model either: those that its run held out, else those it
/// was trained on, against its out-of-fold figures; where these are not kept or have no row for both, it
/// fails and says so. So does one whose training rows no radio measures (ml::plausible_range), or whose usual
/// correction could never be applied. What a manifest claims counts only of models made here: one from
/// elsewhere that no kept row can judge fails. So does one that was not trained on single ranges. Only a
/// person's reason lets a model pass that fails.
GateReport gate_of(const ml::Model& candidate, const ml::Model* current, const GateData& data);

}  // namespace anchord::api
