#include "core/ml/dataset.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/median.hpp"
#include "core/base/sha256.hpp"
#include "core/ml/random.hpp"

namespace anchord::ml {
namespace {

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

std::map<std::uint32_t, std::vector<std::size_t>> rows_by(std::span<const std::uint32_t> id) {
  std::map<std::uint32_t, std::vector<std::size_t>> rows;
  for (std::size_t i = 0; i < id.size(); ++i) rows[id[i]].push_back(i);
  return rows;
}

}  // namespace

Dataset Dataset::subset(std::span<const std::size_t> rows) const {
  Dataset out;
  out.features = features;
  out.group_names = group_names;
  out.x.reserve(rows.size() * columns());
  for (const std::size_t i : rows) {
    const auto from = row(i);
    out.x.insert(out.x.end(), from.begin(), from.end());
    if (labelled()) out.los.push_back(los[i]);
    if (has_truth()) out.bias_m.push_back(bias_m[i]);
    out.weight.push_back(weight[i]);
    out.group.push_back(group[i]);
    out.placement.push_back(placement[i]);
  }
  return out;
}

Result<Dataset> Dataset::with_features(std::span<const std::string> names) const {
  std::vector<std::size_t> columns_taken;
  for (const auto& name : names) {
    const auto found = std::find(features.begin(), features.end(), name);
    if (found == features.end()) return make_error(Errc::not_found, "the data have no feature " + name);
    columns_taken.push_back(static_cast<std::size_t>(found - features.begin()));
  }
  Dataset out = *this;
  out.features.assign(names.begin(), names.end());
  out.x.clear();
  out.x.reserve(rows() * names.size());
  for (std::size_t i = 0; i < rows(); ++i)
    for (const std::size_t c : columns_taken) out.x.push_back(x[i * columns() + c]);
  return out;
}

Dataset Dataset::of_class(bool is_los) const {
  std::vector<std::size_t> rows_taken;
  for (std::size_t i = 0; i < los.size(); ++i)
    if ((los[i] != 0) == is_los) rows_taken.push_back(i);
  return subset(rows_taken);
}

std::string Dataset::digest() const {
  Sha256 sha;
  sha.add(static_cast<std::uint64_t>(rows()));
  for (const auto& name : features) {
    sha.add(name);
    sha.add(std::string_view{"\0", 1});
  }
  for (const double value : x) sha.add(value);
  for (const auto value : los) sha.add(static_cast<std::uint64_t>(value));
  for (const double value : bias_m) sha.add(value);
  if (std::ranges::any_of(weight, [](double w) { return w != 1; }))
    for (const double value : weight) sha.add(value);
  for (const auto value : group) sha.add(static_cast<std::uint64_t>(value));
  for (const auto value : placement) sha.add(static_cast<std::uint64_t>(value));
  return sha.hex();
}

std::vector<std::size_t> range_outliers(std::span<const double> range_m,
                                        std::span<const std::uint32_t> placement, double mads,
                                        double floor_m) {
  std::vector<std::size_t> out;
  for (const auto& [id, rows] : rows_by(placement)) {
    if (rows.size() < 5) continue;
    std::vector<double> values;
    for (const std::size_t i : rows) values.push_back(range_m[i]);
    const double middle = median(values);
    for (double& v : values) v = std::abs(v - middle);
    const double limit = std::max(floor_m, mads * 1.4826 * median(values));
    for (const std::size_t i : rows)
      if (std::abs(range_m[i] - middle) > limit) out.push_back(i);
  }
  std::sort(out.begin(), out.end());
  return out;
}

void weigh_by_truth(Dataset& data, std::span<const std::optional<double>> truth_sigma_m) {
  constexpr double k_least_scatter_m = 0.01;  // of the radio itself, however alike the biases look
  if (!data.has_truth() ||
      std::ranges::none_of(truth_sigma_m, [](const auto& s) { return s.value_or(0) > 0; }))
    return;
  for (const bool is_los : {true, false}) {
    std::vector<std::size_t> rows;
    std::vector<double> biases;
    for (std::size_t i = 0; i < data.rows(); ++i) {
      if ((!data.labelled() || data.los[i] != 0) != is_los) continue;
      rows.push_back(i);
      biases.push_back(data.bias_m[i]);
    }
    if (rows.empty()) continue;
    const double middle = median(biases);
    for (double& b : biases) b = std::abs(b - middle);
    const double scatter_m = std::max(k_least_scatter_m, 1.4826 * median(biases));
    double sum = 0;
    for (const std::size_t i : rows) {
      const double sigma_m = truth_sigma_m[i].value_or(0);
      sum += data.weight[i] = scatter_m * scatter_m / (scatter_m * scatter_m + sigma_m * sigma_m);
    }
    for (const std::size_t i : rows) data.weight[i] *= static_cast<double>(rows.size()) / sum;
  }
}

Dataset aggregate_placements(const Dataset& data, bool mean) {
  const auto middle = [mean](std::vector<double> v) { return mean ? mean_of(v) : median(v); };
  std::vector<std::size_t> firsts;
  const auto placements = rows_by(data.placement);
  for (const auto& [id, rows] : placements) firsts.push_back(rows.front());
  Dataset out = data.subset(firsts);
  std::size_t at = 0;
  for (const auto& [id, rows] : placements) {
    std::vector<double> values(rows.size());
    for (std::size_t c = 0; c < data.columns(); ++c) {
      for (std::size_t r = 0; r < rows.size(); ++r) values[r] = data.x[rows[r] * data.columns() + c];
      out.x[at * data.columns() + c] = middle(values);
    }
    std::size_t los = 0;
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if (data.has_truth()) values[r] = data.bias_m[rows[r]];
      if (data.labelled()) los += data.los[rows[r]];
    }
    if (data.has_truth()) out.bias_m[at] = middle(values);
    if (data.labelled()) out.los[at] = 2 * los > rows.size() ? 1 : 0;
    ++at;
  }
  return out;
}

std::string place_name(const Dataset& data, std::uint32_t group) {
  return group < data.group_names.size() && !data.group_names[group].empty() ? data.group_names[group]
                                                                             : std::to_string(group);
}

Dataset thin_placements(const Dataset& data, std::size_t per_placement) {
  std::vector<std::size_t> taken;
  std::vector<double> weight;
  for (const auto& [id, rows] : rows_by(data.placement)) {
    const std::size_t n = std::min(per_placement, rows.size());
    for (std::size_t j = 0; j < n; ++j) {
      taken.push_back(rows[(2 * j + 1) * rows.size() / (2 * n)]);
      weight.push_back(data.weight[taken.back()] / static_cast<double>(n));
    }
  }
  Dataset out = data.subset(taken);
  out.weight = std::move(weight);
  return out;
}

std::vector<std::size_t> grouped_folds(std::span<const std::uint32_t> group, std::size_t k,
                                       std::uint64_t seed) {
  const auto by_group = rows_by(group);
  std::vector<std::uint32_t> order;
  for (const auto& [id, rows] : by_group) order.push_back(id);
  Random random{seed};
  random.shuffle(order);
  std::stable_sort(order.begin(), order.end(),
                   [&](auto a, auto b) { return by_group.at(a).size() > by_group.at(b).size(); });
  const std::size_t folds = std::max<std::size_t>(1, std::min(k, order.size()));
  std::vector<std::size_t> filled(folds, 0), fold(group.size(), 0);
  for (const std::uint32_t id : order) {
    const auto lightest =
        static_cast<std::size_t>(std::min_element(filled.begin(), filled.end()) - filled.begin());
    filled[lightest] += by_group.at(id).size();
    for (const std::size_t i : by_group.at(id)) fold[i] = lightest;
  }
  return fold;
}

std::vector<std::size_t> rows_of_fold(std::span<const std::size_t> fold, std::size_t which, bool inside) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < fold.size(); ++i)
    if ((fold[i] == which) == inside) rows.push_back(i);
  return rows;
}

std::size_t count_distinct(std::span<const std::uint32_t> ids) {
  return std::set<std::uint32_t>(ids.begin(), ids.end()).size();
}

}  // namespace anchord::ml
