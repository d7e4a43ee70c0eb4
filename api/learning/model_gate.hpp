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
  std::string basis;  ///< held_out: both on the same places; manifest: each on its own cross-validation
};

struct GateReport {
  bool passed{true};
  std::vector<GateCheck> checks;
  std::string why;  ///< what did not pass, in words
};

/// A model takes over by default only where it does not worsen what it replaces: FPR of an identification,
/// MAE of a correction; and a correction must help at all. held_out  a data set whose test part both are
/// measured on; null, or without a test part: their manifests'
///           figures
GateReport gate_of(const ml::Model& candidate, const ml::Model* current, const DatasetTable* held_out);

}  // namespace anchord::api
