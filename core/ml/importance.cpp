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
    for (const auto i : t.unseen) sum[i] += score(t.tree, rows.row(i)), count[i] += 1;
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
                                                       bool classification, int repeats) {
  BOOST_OUTCOME_TRY(const auto chosen, all.with_features(recipe.features));
  const Dataset data = thin_placements(chosen, recipe.per_placement);
  std::vector<double> y(data.los.begin(), data.los.end());
  if (!classification) y = data.bias_m;
  if (y.size() != data.rows() || y.empty())
    return make_error(Errc::invalid_argument, "the data have no answers to learn");
  std::vector<double> x = data.x;
  const TrainingRows rows{x, data.columns(), y, data.weight};
  std::vector<BaggedTree> trees;
  auto options = recipe.forest;
  options.trees = 1;
  for (int t = 0; t < recipe.forest.trees; ++t) {
    options.seed = recipe.forest.seed + 7919 * static_cast<std::uint64_t>(t + 1);
    std::vector<double> out_of_bag;
    auto tree = fit_forest(rows, options, &out_of_bag);
    std::vector<std::size_t> unseen;
    for (std::size_t i = 0; i < out_of_bag.size(); ++i)
      if (!std::isnan(out_of_bag[i])) unseen.push_back(i);
    trees.push_back({std::move(tree), std::move(unseen)});
  }
  const double whole = std::max(loss_of(trees, rows), 1e-12);
  Random random{recipe.forest.seed};
  std::vector<Importance> out;
  for (std::size_t f = 0; f < data.columns(); ++f) {
    double sum = 0, squares = 0;
    for (int r = 0; r < repeats; ++r) {
      std::vector<double> column;
      for (std::size_t i = 0; i < data.rows(); ++i) column.push_back(data.x[i * data.columns() + f]);
      random.shuffle(column);
      for (std::size_t i = 0; i < data.rows(); ++i) x[i * data.columns() + f] = column[i];
      const double rise = (loss_of(trees, rows) - whole) / whole;
      sum += rise;
      squares += rise * rise;
    }
    for (std::size_t i = 0; i < data.rows(); ++i) x[i * data.columns() + f] = data.x[i * data.columns() + f];
    const double mean = sum / repeats;
    out.push_back({data.features[f], mean, std::sqrt(std::max(0.0, squares / repeats - mean * mean))});
  }
  std::stable_sort(out.begin(), out.end(), [](const auto& a, const auto& b) { return a.mean > b.mean; });
  return out;
}

Result<std::vector<ForwardStep>> forward_filter(const Dataset& data, Recipe recipe,
                                                const std::vector<std::string>& order,
                                                const std::vector<std::size_t>& fold, bool classification,
                                                double least_gain) {
  recipe.features.clear();
  std::vector<ForwardStep> out;
  double best = 1e300;
  for (const auto& name : order) {
    recipe.features.push_back(name);
    BOOST_OUTCOME_TRY(const auto result, cross_validate(data, recipe, fold, classification));
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
