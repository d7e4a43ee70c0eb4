#pragma once

#include <cstddef>
#include <optional>

#include "api/learning/dataset_table.hpp"
#include "core/ml/predictor.hpp"

namespace anchord::api {

/// What corrections leave of the errors of the same ranges, mean of the magnitudes in metres, with the models
/// that are active and with a candidate among them: an identification brings the P(LOS) that a correction of
/// both classes is weighted by.
struct Together {
  std::size_t n_rows{};
  double mae_m{}, mae_before_m{};
};

/// On the held-out single ranges of `table` with a true distance; copies of training rows are left out.
/// before  the active models; after  the same with the candidate in its place
/// returns  nothing where neither corrects anything, or fewer rows than least_rows can be compared
std::optional<Together> corrected_together(const ml::ModelSet& before, const ml::ModelSet& after,
                                           ml::Correction how, const DatasetTable& table,
                                           std::size_t least_rows);

}  // namespace anchord::api
