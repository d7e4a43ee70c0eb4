#include "api/learning/kept_data.hpp"

#include <algorithm>

namespace anchord::api {
namespace {

constexpr std::size_t k_most_sets = 20, k_most_rows = 50'000;

}  // namespace

Result<KeptData> kept_data(DatasetStore& datasets, std::span<const std::string> learned) {
  KeptData out;
  BOOST_OUTCOME_TRY(const auto sets, datasets.datasets(k_most_sets, std::nullopt));
  for (const auto& set : sets) {
    BOOST_OUTCOME_TRY(const auto csv, datasets.csv(set.id));
    auto parsed = DatasetTable::parse(csv);
    if (!parsed) continue;
    auto& rows = parsed.value().rows;
    const bool held_out = std::ranges::any_of(rows, [](const DatasetRow& row) { return row.test; });
    if (!held_out && std::ranges::find(learned, set.digest) != learned.end()) continue;
    if (held_out) std::erase_if(rows, [](const DatasetRow& row) { return !row.test; });
    if (out.table.rows.size() + rows.size() > k_most_rows) continue;
    for (auto& row : rows) {
      row.test = true;
      row.registers.clear();  // live ranges have none, and other sets have others
      out.table.rows.push_back(std::move(row));
    }
    out.names.push_back(set.name);
  }
  return out;
}

Result<std::optional<DatasetTable>> table_of_digest(DatasetStore& datasets, std::string_view digest) {
  constexpr std::size_t k_page = 200;
  std::optional<DatasetId> after;
  while (true) {
    BOOST_OUTCOME_TRY(const auto sets, datasets.datasets(k_page, after));
    for (const auto& set : sets) {
      if (set.digest != digest) continue;
      BOOST_OUTCOME_TRY(const auto csv, datasets.csv(set.id));
      auto parsed = DatasetTable::parse(csv);
      if (!parsed) return std::optional<DatasetTable>{};  // of another version of the features
      return std::optional{std::move(parsed).value()};
    }
    if (sets.size() < k_page) return std::optional<DatasetTable>{};
    after = sets.back().id;
  }
}

}  // namespace anchord::api
