#include "api/learning/split_leak.hpp"

#include <algorithm>

namespace anchord::api {

std::vector<double> numbers_of(const DatasetRow& row) {
  std::vector<double> values;
  for (std::size_t f = 0; f < nlos::k_feature_count; ++f)
    if (row.features.present.test(f)) values.push_back(row.features.values[f]);
  values.push_back(row.true_range_m.value_or(-1));
  return values;
}

std::set<std::vector<double>> trained_numbers(const DatasetTable& table) {
  std::set<std::vector<double>> trained;
  for (const auto& row : table.rows)
    if (!row.test) trained.insert(numbers_of(row));
  return trained;
}

std::size_t copies(const DatasetTable& table) {
  const auto trained = trained_numbers(table);
  return static_cast<std::size_t>(std::ranges::count_if(
      table.rows, [&](const auto& row) { return row.test && trained.contains(numbers_of(row)); }));
}

}  // namespace anchord::api
