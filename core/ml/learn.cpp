#include "core/ml/learn.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include "core/ml/learn_bias.hpp"

namespace anchord::ml {
namespace {

// Log losses closer than this are noise on a few hundred placements: then the order of the candidates
// decides.
constexpr double k_tie_log_loss = 0.01;

std::string fixed(double value, int digits) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.*f", digits, value);
  return text.data();
}

// Settings of an SVM are compared on fewer rows where there are many of them, drawn evenly: fitting grows
// with the square of the rows, and scoring with the support vectors. The pick is validated and fitted on all
// it may have.
constexpr std::size_t k_few_svms = 8, k_search_rows = 2000, k_compared_rows = 4000;

struct Compared {
  Dataset data;
  std::vector<std::size_t> fold;
};

// Nothing where the rows are few enough as they are, or a fold would be left with hardly any.
std::optional<Compared> compared_rows(const Dataset& data, const std::vector<std::size_t>& fold) {
  if (data.rows() <= k_compared_rows) return std::nullopt;
  std::vector<std::size_t> rows, of_fold(*std::max_element(fold.begin(), fold.end()) + 1, 0);
  Compared out;
  for (std::size_t i = 0; i < k_compared_rows; ++i) {
    rows.push_back((2 * i + 1) * data.rows() / (2 * k_compared_rows));
    out.fold.push_back(fold[rows.back()]);
    ++of_fold[out.fold.back()];
  }
  if (*std::min_element(of_fold.begin(), of_fold.end()) < 20) return std::nullopt;
  out.data = data.subset(rows);
  return out;
}

std::vector<Recipe> for_search(std::vector<Recipe> candidates) {
  const auto svms = std::count_if(candidates.begin(), candidates.end(),
                                  [](const Recipe& r) { return r.method == Method::svm; });
  if (static_cast<std::size_t>(svms) <= k_few_svms) return candidates;
  for (auto& r : candidates)
    if (r.method == Method::svm) r.svm.max_rows = std::min(r.svm.max_rows, k_search_rows);
  return candidates;
}

struct Picked {
  Recipe recipe;
  OutOfFold out_of_fold;
  std::string why;
};

void report(const LearnOptions& options, const std::string& detail, std::size_t done, std::size_t of) {
  if (options.progress) options.progress(static_cast<double>(done) / static_cast<double>(of), detail);
}

CandidateRow row_of(const Recipe& recipe, const OutOfFold& result) {
  CandidateRow row;
  row.name = recipe.method == Method::none ? "none (no correction)" : recipe.describe();
  row.loss = result.loss;
  row.loss_sd = result.loss_sd;
  row.method = recipe.method;
  row.settings = settings_of(recipe);
  row.features = recipe.features;
  return row;
}

// What each fold says of one candidate.
void add_folds(const Dataset& data, const std::vector<std::size_t>& fold, std::size_t candidate,
               const OutOfFold& result, std::vector<FoldRow>& out) {
  const std::size_t first = out.size();
  for (std::size_t k = 0; k < result.fold_loss.size(); ++k)
    out.push_back({candidate, k, 0, 0, result.fold_loss[k], {}, 0, 0});
  for (std::size_t i = 0; i < data.rows(); ++i) {
    auto& row = out[first + fold[i]];
    row.test_rows += 1;
    if (!result.p_los.empty()) row.confusion.count(data.los[i] != 0, result.p_los[i] >= 0.5);
    if (result.bias_m.empty()) continue;
    row.mae_raw_m += std::abs(data.bias_m[i]);
    row.mae_m += std::abs(data.bias_m[i] - result.bias_m[i]);
  }
  for (std::size_t k = first; k < out.size(); ++k) {
    const auto n = static_cast<double>(std::max<std::size_t>(out[k].test_rows, 1));
    out[k].train_rows = data.rows() - out[k].test_rows;
    out[k].mae_raw_m /= n;
    out[k].mae_m /= n;
  }
}

Result<Picked> pick_classifier(const Dataset& data, const LearnOptions& options,
                               const std::vector<std::size_t>& fold, std::vector<CandidateRow>& table,
                               std::vector<FoldRow>& folds) {
  const auto candidates = classifier_candidates(data, options);
  if (candidates.empty()) return make_error(Errc::not_found, "no candidate's features are in the data");
  const auto searched = for_search(candidates);
  const auto few = compared_rows(data, fold);
  std::vector<OutOfFold> results;
  std::size_t best = 0;
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    report(options, candidates[c].describe(), c, candidates.size());
    const bool light = few && searched[c].svm.max_rows != candidates[c].svm.max_rows;
    const auto& on = light ? few->data : data;
    const auto& on_fold = light ? few->fold : fold;
    BOOST_OUTCOME_TRY(auto result, cross_validate(on, searched[c], on_fold, true, options.run));
    table.push_back(row_of(candidates[c], result));
    table.back().confusion = confusion_at(result.p_los, on.los, 0.5);
    table.back().brier = brier(result.p_los, on.los);
    add_folds(on, on_fold, c, result, folds);
    if (!results.empty() && result.loss < results[best].loss - k_tie_log_loss) best = c;
    results.push_back(std::move(result));
  }
  table[best].picked = true;
  if (searched[best].svm.max_rows != candidates[best].svm.max_rows) {
    BOOST_OUTCOME_TRY(results[best], cross_validate(data, candidates[best], fold, true, options.run));
  }
  std::string why = candidates.size() == 1
                        ? "the only candidate: "
                        : "lowest grouped log loss, ties within 0.01 to the earlier in the table: ";
  why += candidates[best].describe() + " " + fixed(results[best].loss, 3) + " over " +
         std::to_string(candidates.size()) + " candidates";
  return Picked{candidates[best], std::move(results[best]), why};
}

// Threshold with at most `max_fpr` of the out-of-fold NLOS rows on the LOS side. A cap only ever tightens:
// where the usual threshold keeps it already, nothing is given away.
double threshold_for(std::span<const double> p_los, std::span<const std::uint8_t> los, double max_fpr) {
  constexpr double k_usual = 0.5;
  double threshold = 0.995;
  for (const auto& point : roc(p_los, los))
    if (point.fpr <= max_fpr && point.threshold < 1) threshold = std::min(threshold, point.threshold);
  return std::max(threshold, k_usual);
}

}  // namespace

Result<Learned> learn_class(const Dataset& data, const LearnOptions& options,
                            const std::vector<std::size_t>& fold) {
  Learned out;
  BOOST_OUTCOME_TRY(auto picked, pick_classifier(data, options, fold, out.table, out.folds));
  BOOST_OUTCOME_TRY(auto classifier, fit_classifier(data, picked.recipe, options.run));
  classifier.slope = picked.out_of_fold.platt.slope;
  classifier.offset = picked.out_of_fold.platt.offset;
  if (options.max_fpr)
    classifier.threshold = threshold_for(picked.out_of_fold.p_los, data.los, *options.max_fpr);
  out.p_los = std::move(picked.out_of_fold.p_los);
  out.picked = picked.recipe;
  const auto c = confusion_at(out.p_los, data.los, classifier.threshold);
  out.model.info.features = picked.recipe.features;
  out.model.info.method = picked.recipe.describe();
  out.model.info.why = picked.why;
  out.model.info.metrics = {{"accuracy", c.accuracy()},
                            {"balanced_accuracy", c.balanced_accuracy()},
                            {"fpr", c.fpr()},
                            {"fnr", c.fnr()},
                            {"log_loss", picked.out_of_fold.loss},
                            {"log_loss_sd", picked.out_of_fold.loss_sd},
                            {"brier", brier(out.p_los, data.los)}};
  out.model.classifier = std::move(classifier);
  return out;
}

namespace {

std::vector<double> minus(std::span<const double> a, std::span<const double> b, double gain) {
  std::vector<double> out;
  for (std::size_t i = 0; i < a.size(); ++i) out.push_back(a[i] - gain * b[i]);
  return out;
}

// Robust spread of what the correction leaves: quantile of 68 % of the magnitudes, never below 5 mm.
double spread_m(std::span<const double> residual_m, std::span<const double> weight) {
  std::vector<std::pair<double, double>> squares;
  for (std::size_t i = 0; i < residual_m.size(); ++i)
    squares.emplace_back(std::abs(residual_m[i]), weight[i]);
  std::sort(squares.begin(), squares.end());
  double total = 0, below = 0;
  for (const auto& [value, w] : squares) total += w;
  for (const auto& [value, w] : squares) {
    below += w;
    if (below >= 0.6827 * total) return std::max(0.005, value);
  }
  return 0.005;
}

double gaussian_nll(std::span<const double> residual_m, std::span<const double> weight, double sigma_m) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < residual_m.size(); ++i) {
    const double z = residual_m[i] / sigma_m;
    sum -= weight[i] * std::log(0.99 * std::exp(-0.5 * z * z) / (sigma_m * 2.5066282746310002) + 0.001);
    total += weight[i];
  }
  return sum / total;
}

Result<Learned> learn_regression(const Dataset& data, const LearnOptions& options,
                                 const std::vector<std::size_t>& fold) {
  Learned out;
  const auto candidates = regressor_candidates(data, options);
  const auto searched = for_search(candidates);
  const auto few = compared_rows(data, fold);
  std::vector<OutOfFold> results;
  std::size_t best = !options.methods.empty() && candidates.size() > 1 ? 1 : 0;
  std::size_t constant = 0;
  const auto cost = [](const OutOfFold& r) {
    return r.loss + k_harm_price * std::max(0.0, r.worst_harm_m - k_harmless_m);
  };
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    report(options, candidates[c].describe(), c, candidates.size());
    const bool light = few && searched[c].svm.max_rows != candidates[c].svm.max_rows;
    const auto& on = light ? few->data : data;
    const auto& on_fold = light ? few->fold : fold;
    BOOST_OUTCOME_TRY(auto result, cross_validate(on, searched[c], on_fold, false, options.run));
    out.table.push_back(row_of(candidates[c], result));
    out.table.back().error = error_stats(minus(on.bias_m, result.bias_m, 1));
    out.table.back().worst_harm_m = result.worst_harm_m;
    add_folds(on, on_fold, c, result, out.folds);
    results.push_back(std::move(result));
    if (candidates[c].method == Method::constant) constant = c;
    if (c > best && cost(results[c]) < cost(results[best]) * 0.99 - 1e-4) best = c;
  }
  out.table[best].picked = true;
  if (searched[best].svm.max_rows != candidates[best].svm.max_rows) {
    BOOST_OUTCOME_TRY(results[best], cross_validate(data, candidates[best], fold, false, options.run));
  }
  BOOST_OUTCOME_TRY(auto regressor, fit_regressor(data, candidates[best], options.run));
  const auto weight = placement_weights(data);
  const auto left = minus(data.bias_m, results[best].bias_m, 1);
  regressor.sigma_m = spread_m(left, weight);
  out.nll = gaussian_nll(left, weight, regressor.sigma_m);
  const auto left_constant = minus(data.bias_m, results[constant].bias_m, 1);
  out.nll_constants = gaussian_nll(left_constant, weight, spread_m(left_constant, weight));
  out.correction_m = std::move(results[best].bias_m);
  out.picked = candidates[best];
  const auto raw = error_stats(data.bias_m), corrected = error_stats(left);
  out.model.info.features = candidates[best].features;
  out.model.info.method = candidates[best].describe();
  out.model.info.why =
      "lowest grouped MAE plus 0.5 of the worst place's harm beyond 2 cm, ties within 1 % to the earlier in "
      "the table, over " +
      std::to_string(candidates.size()) + " candidates";
  out.model.info.metrics = {{"mae_raw_m", raw.mae_m},
                            {"mae_m", corrected.mae_m},
                            {"mse_raw_m2", raw.mse_m2},
                            {"mse_m2", corrected.mse_m2},
                            {"worst_place_harm_m", results[best].worst_harm_m},
                            {"nll", out.nll},
                            {"nll_constants", out.nll_constants}};
  out.model.regressor = std::move(regressor);
  return out;
}

// An SVM sees at most a few thousand rows; whoever reads the manifest should know.
std::string svm_note(const Dataset& data, const Recipe& picked) {
  if (picked.method != Method::svm && picked.method != Method::average) return {};
  std::map<std::uint32_t, std::size_t> repeats;
  std::size_t rows = 0;
  for (const auto id : data.placement) rows += repeats[id]++ < picked.per_placement ? 1 : 0;
  if (rows <= picked.svm.max_rows) return {};
  return "; the SVM is fitted to " + std::to_string(picked.svm.max_rows) + " of " + std::to_string(rows) +
         " rows, drawn evenly";
}

}  // namespace

Result<Learned> learn(const Dataset& data, const LearnOptions& asked) {
  if (count_distinct(data.group) < 2)
    return make_error(
        Errc::too_few_observations,
        "all rows are of one place: nothing can be held out; name other columns with --group-by");
  LearnOptions options = asked;
  const bool by_method = !asked.methods.empty();
  if (options.engine == Engine::opencv && !by_method) options.methods = {Method::svm, Method::random_forest};
  const auto fold = grouped_folds(data.group, options.folds, options.seed);
  const bool classes = options.task == Task::nlos_id || (options.task == Task::bias && data.labelled());
  if (options.task != Task::nlos_id && !data.has_truth())
    return make_error(Errc::not_found, "a bias needs true ranges");
  if (options.task == Task::nlos_id && !data.labelled())
    return make_error(Errc::not_found, "identification needs labels");
  const bool mixture = options.task == Task::bias && classes && !by_method;
  auto learned = options.task == Task::nlos_id ? learn_class(data, options, fold)
                 : mixture                     ? learn_bias_mixture(data, options, fold)
                                               : learn_regression(data, options, fold);
  if (!learned) return learned.error();
  learned.value().fold = fold;
  auto& info = learned.value().model.info;
  info.why += svm_note(data, learned.value().picked);
  info.task = options.task;
  info.data_digest = data.digest();
  info.rows = data.rows();
  info.placements = count_distinct(data.placement);
  info.groups = count_distinct(data.group);
  info.folds = *std::max_element(fold.begin(), fold.end()) + 1;
  info.seed = options.seed;
  return learned;
}

}  // namespace anchord::ml
