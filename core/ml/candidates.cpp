#include <algorithm>
#include <array>

#include "core/ml/learn.hpp"

namespace anchord::ml {
namespace {

using Names = std::vector<std::string>;

// Feature sets that carried over to unseen places in public data; a set counts where the data have at least
// its first three.
const Names k_base{"range_m",   "rx_dbm",       "rx_minus_fp_db", "noise_excess_db",
                   "fp_snr_db", "total_snr_db", "preamble_db"};
const Names k_shape{"range_m",      "rx_dbm",      "rx_minus_fp_db", "noise_excess_db", "fp_snr_db",
                    "total_snr_db", "preamble_db", "fp_shape12_db",  "fp_shape32_db"};
const Names k_levels{"range_m", "rx_dbm", "fp_dbm"};
const Names k_first_path{"fp_free_space_db", "rx_minus_fp_db", "range_m"};
const Names k_first_path_range{"fp_free_space_db", "rx_minus_fp_db"};
const Names k_early{"fp_free_space_db", "early_energy", "noise_excess_db"};
const Names k_thesis{"range_m", "rx_dbm", "fp_dbm", "mean_excess_delay_ns", "rms_delay_spread_ns",
                     "kurtosis"};

bool has(const Dataset& data, const std::string& name) {
  return std::find(data.features.begin(), data.features.end(), name) != data.features.end();
}

bool has_all(const Dataset& data, const Names& names) {
  return std::all_of(names.begin(), names.end(), [&](const auto& n) { return has(data, n); });
}

void add(std::vector<Recipe>& out, const Dataset& data, Recipe recipe, const Names& features) {
  if (!has_all(data, features)) return;
  recipe.features = features;
  out.push_back(std::move(recipe));
}

bool wanted(const LearnOptions& options, Method method) {
  return std::find(options.methods.begin(), options.methods.end(), method) != options.methods.end();
}

// The declared values of each setting: the caller's grid, the default one, or the defaults alone.
std::map<std::string, std::vector<double>> axes(const LearnOptions& options, Method method,
                                                bool classification) {
  if (const auto found = options.grid.find(method); found != options.grid.end()) return found->second;
  if (options.search) return default_grid(method, classification);
  return {};
}

// What the engine can fit it fits; corrections by nothing and by a constant are nobody's.
std::vector<Recipe> by_engine(std::vector<Recipe> recipes, Engine engine) {
  for (Recipe& recipe : recipes) {
    if (engine == Engine::own || !fits(engine, recipe.method)) continue;
    recipe.engine = engine;
    recipe.svm.max_rows = most_svm_rows(engine);
  }
  return recipes;
}

Recipe boosted(const LearnOptions& options, std::size_t rows) {
  Recipe r;
  r.method = Method::boosted;
  r.per_placement = options.per_placement;
  r.clip = 0;  // trees do not extrapolate
  r.boosted.rounds = rows > 5000 ? 600 : 150;
  r.boosted.depth = rows > 5000 ? 6 : 3;
  r.boosted.learning_rate = 0.05;
  r.boosted.column_share = 0.4;
  r.boosted.seed = options.seed;
  return r;
}

Recipe many_row_forest(const LearnOptions& options) {
  Recipe r;
  r.method = Method::random_forest;
  r.per_placement = options.per_placement;
  r.clip = 0;
  r.forest.seed = options.seed;
  r.forest.leaf_share = 0.0003;
  r.forest.trees = 60;
  return r;
}

Recipe tree_average(const LearnOptions& options, std::size_t rows) {
  Recipe r = boosted(options, rows);
  r.method = Method::tree_average;
  r.forest = many_row_forest(options).forest;
  if (rows <= 5000) r.forest.leaf_share = 0.02;
  return r;
}

}  // namespace

std::vector<Recipe> classifier_candidates(const Dataset& data, const LearnOptions& options) {
  const std::size_t placements = count_distinct(data.placement);
  const bool few = placements < 40;
  Recipe plain;
  plain.per_placement = options.per_placement;
  plain.forest.seed = options.seed;
  if (few) {
    plain.c = 0.3;
    plain.svm.c = 1;
    plain.forest.leaf_share = 0.08;
  }

  std::vector<Names> sets;
  if (!options.features.empty())
    sets = {options.features};
  else if (few)
    sets = {k_early, k_first_path_range, k_first_path, k_levels, k_thesis};
  else if (has_all(data, k_base))
    sets = {k_base, k_shape};
  else
    sets = {k_levels, k_first_path, k_early};
  if (options.features.empty() &&
      std::none_of(sets.begin(), sets.end(), [&](const auto& s) { return has_all(data, s); })) {
    sets = {Names(data.features.begin(),
                  data.features.begin() +
                      static_cast<std::ptrdiff_t>(std::min<std::size_t>(data.columns(), k_max_features)))};
  }

  // The average first: each single family fails on some set, so it must be beaten clearly, not tied.
  std::vector<Method> methods{Method::average, Method::logistic, Method::random_forest};
  const bool chosen = !options.methods.empty();
  if (chosen) methods = options.methods;
  // Many rows without placements: the small models are for the table, trees on everything win.
  const bool many = placements > 5000;
  if (many && !chosen) methods.clear();

  std::vector<Recipe> out;
  for (const auto& set : sets) {
    for (const auto method : methods) {
      if (method == Method::boosted || method == Method::tree_average) continue;
      Recipe r = plain;
      r.method = method;
      for (const auto& point : expand(r, axes(options, method, true))) add(out, data, point, set);
    }
  }
  if ((many && !chosen) || wanted(options, Method::boosted)) {
    const auto& everything = options.features.empty() ? data.features : options.features;
    const Names first(everything.begin(), everything.begin() + static_cast<std::ptrdiff_t>(std::min(
                                                                   everything.size(), k_max_features)));
    // The average first: its votes are the steadier, and it must be beaten clearly.
    if (many && !chosen) add(out, data, tree_average(options, placements), first);
    for (const auto& r : expand(boosted(options, placements), axes(options, Method::boosted, true)))
      add(out, data, r, first);
    if (many && !chosen) {
      add(out, data, many_row_forest(options), first);
      Recipe logistic = plain;
      logistic.method = Method::logistic;
      add(out, data, logistic, first);
    }
  }
  if (wanted(options, Method::tree_average)) {
    const auto& everything = options.features.empty() ? data.features : options.features;
    for (const auto& r : expand(tree_average(options, placements), axes(options, Method::tree_average, true)))
      add(out, data, r,
          Names(everything.begin(), everything.begin() + static_cast<std::ptrdiff_t>(
                                                             std::min(everything.size(), k_max_features))));
  }
  return by_engine(std::move(out), options.engine);
}

std::vector<Recipe> regressor_candidates(const Dataset& data, const LearnOptions& options) {
  std::vector<Recipe> out;
  const bool height = has(data, "height_difference_m");
  Names levels;
  for (const auto& name : k_levels)
    if (has(data, name)) levels.push_back(name);
  if (height) levels.emplace_back("height_difference_m");
  if (!options.features.empty()) levels = options.features;
  if (levels.empty()) levels = {data.features.front()};
  Recipe r;
  r.per_placement = options.per_placement;
  r.clip = 2.5;
  r.forest.seed = options.seed;
  r.forest.leaf_share = 0.04;
  const auto tried = [&](Method m) { return options.methods.empty() || wanted(options, m); };
  const auto add_all = [&](const Recipe& base) {
    for (const auto& point : expand(base, axes(options, base.method, false))) out.push_back(point);
  };

  r.method = Method::none;
  r.features = {levels.front()};
  out.push_back(r);  // always: the row every correction is measured against
  r.method = Method::constant;
  if (tried(r.method)) out.push_back(r);
  r.method = Method::univariate;
  for (const auto& name : levels) {
    if (!tried(r.method) || (name == "height_difference_m" && options.features.empty())) continue;
    r.features = {name};
    auto degrees = axes(options, r.method, false);
    if (degrees.empty()) degrees = {{"degree", {1, 2, 3, 4}}};
    for (const auto& point : expand(r, degrees)) out.push_back(point);
  }
  r.features = levels;
  r.method = Method::least_absolute;
  if (tried(r.method)) out.push_back(r);
  r.method = Method::multivariate;
  if (tried(r.method) && levels.size() > 1) {
    auto degrees = axes(options, r.method, false);
    if (degrees.empty()) degrees = {{"degree", {1, 2, 3}}};
    for (const auto& point : expand(r, degrees)) out.push_back(point);
  }
  r.method = Method::svm;
  r.svm.c = 1;
  r.svm.gamma = 0.1;
  r.svm.epsilon_m = 0.01;
  if (tried(r.method)) add_all(r);
  r.method = Method::random_forest;
  r.clip = 0;
  r.forest.features_per_split = std::max<std::size_t>(1, (levels.size() + 1) / 2);
  r.forest.leaf_share = 0.02;
  if (tried(r.method)) add_all(r);
  if (wanted(options, Method::boosted)) {
    auto b = boosted(options, count_distinct(data.placement));
    b.features = levels;
    add_all(b);
  }
  return by_engine(std::move(out), options.engine);
}

}  // namespace anchord::ml
