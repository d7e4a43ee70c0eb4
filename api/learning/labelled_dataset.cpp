#include "api/learning/labelled_dataset.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <set>

#include "api/learning/dataset_table.hpp"

namespace anchord::api {
namespace {

std::optional<double> finite(double value) { return std::isnan(value) ? std::nullopt : std::optional{value}; }

/// Where a feature of the set comes from: computed, or a column of the table.
struct Source {
  std::optional<nlos::Feature> feature;
  std::size_t column{};
  std::optional<double> of(const LabelledTable& table, std::size_t row) const {
    return feature ? table.features[row].get(*feature)
                   : finite(table.raw[row * table.raw_names.size() + column]);
  }
};

Result<std::vector<Source>> sources_of(const LabelledTable& table, const std::vector<std::string>& names) {
  std::vector<Source> out;
  for (const auto& name : names) {
    const auto feature = nlos::feature_of(name);
    const auto column = std::find(table.raw_names.begin(), table.raw_names.end(), name);
    if (!feature && column == table.raw_names.end())
      return make_error(Errc::not_found, "no feature or column named " + name);
    out.push_back({feature, static_cast<std::size_t>(column - table.raw_names.begin())});
  }
  return out;
}

void count(Dropped& dropped, const std::string& reason, const std::string& where) {
  auto& entry = dropped[reason];
  if (entry.first++ == 0) entry.second = where;
}

std::string named(const std::vector<std::string>& names, std::uint32_t id) {
  return id < names.size() && !names[id].empty() ? names[id] : std::to_string(id);
}

/// "measurements/hall a.csv.gz" is the campaign "hall a".
std::string stem_of(const std::string& path) {
  const auto name = std::filesystem::path(path).filename().string();
  return name.substr(0, name.find('.', 1));
}

}  // namespace

std::string LabelledTable::where(std::size_t row) const {
  if (row >= line.size()) return {};
  return file_names[file[row]] + ":" + std::to_string(line[row]);
}

namespace {

/// How well each true range is known, where a column says it.
std::vector<std::optional<double>> truth_sigmas_m(const LabelledTable& table,
                                                  std::span<const std::size_t> rows) {
  std::vector<std::optional<double>> out(rows.size());
  for (const std::string_view name : {"truth_sigma_m", "truth_sd_m", "truth_accuracy_m"}) {
    const auto at = std::ranges::find(table.raw_names, name);
    if (at == table.raw_names.end()) continue;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const double value =
          table
              .raw[rows[k] * table.raw_names.size() + static_cast<std::size_t>(at - table.raw_names.begin())];
      if (value >= 0 && value <= 100) out[k] = value;
    }
    break;
  }
  return out;
}

}  // namespace

Result<ml::Dataset> dataset_from(const LabelledTable& table, const SetRequest& request,
                                 std::vector<std::size_t>& rows, Dropped& dropped) {
  if (request.need_label && !table.labelled())
    return make_error(Errc::not_found, "no label column (nlos, los, label, cls): name it with --label");
  if (request.need_truth && !table.has_truth())
    return make_error(Errc::not_found, "no column of true ranges (true_range_m): name it with --truth");
  BOOST_OUTCOME_TRY(const auto sources, sources_of(table, request.features));
  ml::Dataset out;
  out.features = request.features;
  out.group_names = table.group_names;
  rows.clear();
  Dropped here;
  std::vector<double> values(sources.size());
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (request.need_truth && !table.true_range_m[i]) {
      count(here, "no " + table.truth_column, table.where(i));
      continue;
    }
    std::string lacking;
    for (std::size_t f = 0; f < sources.size(); ++f) {
      const auto value = sources[f].of(table, i);
      if (!value) lacking += (lacking.empty() ? "" : ", ") + request.features[f];
      values[f] = value.value_or(0);
    }
    if (!lacking.empty()) {  // a row is counted once, with all that it lacks
      count(here, "no " + lacking, table.where(i));
      continue;
    }
    out.x.insert(out.x.end(), values.begin(), values.end());
    if (table.labelled()) out.los.push_back(table.los[i].value_or(false) ? 1 : 0);
    out.weight.push_back(1);
    out.group.push_back(table.group[i]);
    out.placement.push_back(table.placement[i]);
    rows.push_back(i);
  }
  for (const auto& [reason, entry] : here) {
    auto& all = dropped[reason];
    if (all.first == 0) all.second = entry.second;
    all.first += entry.first;
  }
  if (rows.empty()) {
    std::string why;
    for (const auto& [reason, entry] : here)
      why += (why.empty() ? ": " : ", ") + reason + " in " + std::to_string(entry.first) + " (first " +
             entry.second + ")";
    return make_error(Errc::too_few_observations,
                      "no row of " + std::to_string(table.rows()) + " has all that is asked for" + why);
  }
  const auto true_m = [&](std::size_t i) { return table.true_range_m[i]; };
  if (table.has_truth() && std::all_of(rows.begin(), rows.end(), [&](auto i) { return true_m(i); }))
    for (const auto i : rows) out.bias_m.push_back(table.range_m[i] - *true_m(i));
  ml::weigh_by_truth(out, truth_sigmas_m(table, rows));
  return out;
}

DatasetTable dataset_rows(const LabelledTable& table, const std::string& campaign) {
  DatasetTable out;
  const auto all_differ = [](const auto& names) {
    return std::set<std::string>(names.begin(), names.end()).size() == names.size();
  };
  // Names of files without their folders, and of placements without their places, as long as these tell them
  // apart: the digest is of what is measured, not of where a file lies.
  std::vector<std::string> files;
  for (const auto& name : table.file_names) files.push_back(stem_of(name));
  if (!all_differ(files)) files = table.file_names;
  const bool short_settings = all_differ(table.placement_names);
  std::vector<std::size_t> columns;
  for (const auto name : register_columns()) {
    const auto at = std::find(table.raw_names.begin(), table.raw_names.end(), name);
    if (at == table.raw_names.end()) continue;
    columns.push_back(static_cast<std::size_t>(at - table.raw_names.begin()));
    out.registers.emplace_back(name);
  }
  std::vector<std::size_t> all(table.rows());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const auto truth_sigma_m = truth_sigmas_m(table, all);
  for (std::size_t i = 0; i < table.rows(); ++i) {
    DatasetRow row;
    row.truth_sigma_m = truth_sigma_m[i];
    const std::string file = i < table.file.size() ? files[table.file[i]] : "campaign";
    row.campaign = campaign.empty() ? file : campaign;
    row.environment = table.grouping == Grouping::file ? file : named(table.group_names, table.group[i]);
    row.setting = named(table.placement_names, table.placement[i]);
    if (!short_settings) row.setting = file + "/" + row.environment + "/" + row.setting;
    if (table.labelled()) row.los = table.los[i];
    row.true_range_m = table.true_range_m[i];
    row.features = table.features[i];
    for (const auto c : columns) row.registers.push_back(table.raw[i * table.raw_names.size() + c]);
    out.rows.push_back(std::move(row));
  }
  return out;
}

std::vector<std::string> available_features(const LabelledTable& table, bool with_registers,
                                            std::map<std::string, std::size_t>& lacking) {
  std::vector<std::string> out;
  const auto most = static_cast<std::size_t>(0.99 * static_cast<double>(table.rows()));
  for (std::size_t f = 0; f < nlos::k_feature_count; ++f) {
    std::size_t present = 0;
    for (const auto& row : table.features) present += row.present.test(f) ? 1 : 0;
    if (present == 0) continue;
    const std::string name(nlos::feature_name(static_cast<nlos::Feature>(f)));
    if (present >= most)
      out.push_back(name);
    else
      lacking[name] = table.rows() - present;
  }
  if (!with_registers) return out;
  for (const auto name : register_columns()) {
    const auto at = std::find(table.raw_names.begin(), table.raw_names.end(), name);
    if (at == table.raw_names.end()) continue;
    const auto column = static_cast<std::size_t>(at - table.raw_names.begin());
    std::size_t present = 0;
    for (std::size_t i = 0; i < table.rows(); ++i)
      present += std::isnan(table.raw[i * table.raw_names.size() + column]) ? 0 : 1;
    if (present >= most) out.emplace_back(name);
  }
  return out;
}

}  // namespace anchord::api
