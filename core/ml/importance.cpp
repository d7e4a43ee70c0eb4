#include "core/ml/importance.hpp"

#include <algorithm>
#include <cmath>

#include "core/ml/random.hpp"

namespace anchord::ml {
namespace {

// One tree at a time and its own seed, so that each tree's out-of-bag rows are known.
struct BaggedTree {
  Trees tree;
  std::vector<std::size_t> unseen;
};

double loss_of(const std::vector<BaggedTree>& trees, const TrainingRows& rows) {
  std::vector<double> sum(rows.n(), 0), count(rows.n(), 0);
  for (const auto& t : trees)
    for (const auto i : t.unseen) {
      sum[i] += score(t.tree, rows.row(i));
      count[i] += 1;
    }
  double loss = 0, total = 0;
  for (std::size_t i = 0; i < rows.n(); ++i) {
    if (count[i] == 0) continue;
    const double e = rows.y[i] - sum[i] / count[i];
    loss += rows.w[i] * e * e;
    total += rows.w[i];
  }
  return total > 0 ? loss / total : 0;
}

}  // namespace

Result<std::vector<Importance>> permutation_importance(const Dataset& all, const Recipe& recipe,
                                                       bool classification, int repeats,
                                                       const Execution& run) {
  BOOST_OUTCOME_TRY(const auto chosen, all.with_features(recipe.features));
  const Dataset data = thin_placements(chosen, recipe.per_placement);
  std::vector<double> y(data.los.begin(), data.los.end());
  if (!classification) y = data.bias_m;
  if (y.size() != data.rows() || y.empty())
    return make_error(Errc::invalid_argument, "the data have no labels or true ranges to learn from");
  const TrainingRows rows{data.x, data.columns(), y, data.weight};
  std::vector<BaggedTree> trees(static_cast<std::size_t>(std::max(recipe.forest.trees, 0)));
  BOOST_OUTCOME_TRY(parallel_for(trees.size(), run, [&](std::size_t t) -> Result<void> {
    auto options = recipe.forest;
    options.trees = 1;
    options.seed = recipe.forest.seed + 7919 * static_cast<std::uint64_t>(t + 1);
    std::vector<double> out_of_bag;
    auto tree = fit_forest(rows, options, &out_of_bag);
    std::vector<std::size_t> unseen;
    for (std::size_t i = 0; i < out_of_bag.size(); ++i)
      if (!std::isnan(out_of_bag[i])) unseen.push_back(i);
    trees[t] = {std::move(tree), std::move(unseen)};
    return boost::outcome_v2::success();
  }));
  const double whole = std::max(loss_of(trees, rows), 1e-12);
  std::vector<Importance> out(data.columns());
  BOOST_OUTCOME_TRY(parallel_for(data.columns(), run, [&](std::size_t f) -> Result<void> {
    Random random{recipe.forest.seed + 104729 * (f + 1)};
    std::vector<double> x = data.x, column(data.rows());
    const TrainingRows shuffled{x, data.columns(), y, data.weight};
    double sum = 0, squares = 0;
    for (int r = 0; r < repeats && !run.cancelled(); ++r) {
      for (std::size_t i = 0; i < data.rows(); ++i) column[i] = data.x[i * data.columns() + f];
      random.shuffle(column);
      for (std::size_t i = 0; i < data.rows(); ++i) x[i * data.columns() + f] = column[i];
      const double rise = (loss_of(trees, shuffled) - whole) / whole;
      sum += rise;
      squares += rise * rise;
    }
    const double mean = sum / repeats;
    out[f] = {data.features[f], mean, std::sqrt(std::max(0.0, squares / repeats - mean * mean))};
    return boost::outcome_v2::success();
  }));
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.mean > b.mean; });
  return out;
}

Result<std::vector<ForwardStep>> forward_filter(const Dataset& data, Recipe recipe,
                                                const std::vector<std::string>& order,
                                                const std::vector<std::size_t>& fold, bool classification,
                                                double least_gain, const Execution& run) {
  recipe.features.clear();
  std::vector<ForwardStep> out;
  double best = 1e300;
  for (const auto& name : order) {
    recipe.features.push_back(name);
    BOOST_OUTCOME_TRY(const auto result, cross_validate(data, recipe, fold, classification, run));
    const bool kept = result.loss < best - least_gain;
    out.push_back({name, result.loss, kept});
    if (kept)
      best = result.loss;
    else
      recipe.features.pop_back();
  }
  return out;
}

}  // namespace anchord::ml
