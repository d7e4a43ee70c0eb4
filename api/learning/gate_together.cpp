#include "api/learning/gate_together.hpp"

#include <cmath>

#include "api/learning/split_leak.hpp"

namespace anchord::api {

std::optional<Together> corrected_together(const ml::ModelSet& before, const ml::ModelSet& after,
                                           ml::Correction how, const DatasetTable& table,
                                           std::size_t least_rows) {
  const auto old_set = ml::Predictor::make(before), new_set = ml::Predictor::make(after);
  if (!old_set || !new_set) return std::nullopt;
  const auto trained = trained_numbers(table);
  Together out;
  bool corrects = false;
  for (const auto& row : table.rows) {
    if (!row.test || row.repeats != 1 || !row.true_range_m || !(row.range_m() > 0) ||
        trained.contains(numbers_of(row)))
      continue;
    const double error_m = row.range_m() - *row.true_range_m;
    const auto left_m = [&](const ml::Predictor& models) {
      const auto bias_m = models.predict(row.features, how).bias_m;
      corrects |= bias_m.has_value();
      return std::abs(error_m - bias_m.value_or(0));
    };
    out.mae_before_m += left_m(old_set.value());
    out.mae_m += left_m(new_set.value());
    ++out.n_rows;
  }
  if (!corrects || out.n_rows < least_rows) return std::nullopt;
  out.mae_before_m /= static_cast<double>(out.n_rows);
  out.mae_m /= static_cast<double>(out.n_rows);
  return out;
}

}  // namespace anchord::api
