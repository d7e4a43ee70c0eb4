#include "core/ml/recipe.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include "core/ml/sigmoid.hpp"
#include "core/ml/train_opencv.hpp"

namespace anchord::ml {
namespace {

struct Prepared {
  Dataset data;
  Scaler scaler;
  std::vector<double> z;
  std::vector<double> y;
  TrainingRows rows() const { return {z, data.columns(), y, data.weight}; }
};

Result<Prepared> prepare(const Dataset& all, const Recipe& recipe, bool classification) {
  BOOST_OUTCOME_TRY(auto chosen, all.with_features(recipe.features));
  if (chosen.columns() > k_max_features) return make_error(Errc::invalid_argument, "more than 64 features");
  Prepared p;
  p.data = thin_placements(chosen, recipe.per_placement);
  if (p.data.rows() == 0) return make_error(Errc::too_few_observations, "no rows to train on");
  p.scaler = fit_scaler(p.data.x, p.data.columns(), p.data.weight, recipe.clip);
  p.z.resize(p.data.x.size());
  for (std::size_t i = 0; i < p.data.rows(); ++i)
    p.scaler.apply(p.data.row(i), std::span{p.z}.subspan(i * p.data.columns(), p.data.columns()));
  if (classification)
    p.y.assign(p.data.los.begin(), p.data.los.end());
  else
    p.y = p.data.bias_m;
  if (p.y.empty())
    return make_error(Errc::invalid_argument,
                      classification ? "the data have no labels" : "the data have no true ranges");
  if (classification && (std::all_of(p.y.begin(), p.y.end(), [](double v) { return v > 0.5; }) ||
                         std::all_of(p.y.begin(), p.y.end(), [](double v) { return v < 0.5; })))
    return make_error(Errc::too_few_observations, "a classifier needs both LOS and NLOS rows");
  return p;
}

SvmOptions per_row(SvmOptions options, const Dataset& data) {
  double sum = 0;
  for (const double w : data.weight) sum += w;
  options.c *= sum / static_cast<double>(data.rows());
  return options;
}

Result<Svm> fitted_svm(const Prepared& p, const Recipe& recipe, bool classification, const Execution& run) {
  const SvmOptions options = per_row(recipe.svm, p.data);
  if (recipe.engine == Engine::opencv) return fit_svm_opencv(p.rows(), options, classification);
  return fit_svm(p.rows(), options, classification, run);
}

Result<Trees> fitted_forest(const Prepared& p, const Recipe& recipe, const Execution& run) {
  if (recipe.engine == Engine::opencv) return fit_forest_opencv(p.rows(), recipe.forest);
  return fit_forest(p.rows(), recipe.forest, nullptr, run);
}

Result<Classifier::Member> svm_member(const Prepared& p, const Recipe& recipe, const Execution& run) {
  BOOST_OUTCOME_TRY(auto svm, fitted_svm(p, recipe, true, run));
  std::vector<double> margin;
  for (std::size_t i = 0; i < p.data.rows(); ++i) margin.push_back(score(svm, p.rows().row(i)));
  const Platt platt = fit_platt(margin, p.y, p.data.weight);
  return Classifier::Member{std::move(svm), false, platt.slope, platt.offset};
}

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

}  // namespace

std::size_t most_svm_rows(Engine engine) { return engine == Engine::opencv ? 20'000 : SvmOptions{}.max_rows; }

bool fits(Engine engine, Method method) {
  return engine == Engine::own || method == Method::svm || method == Method::random_forest;
}

std::string Recipe::describe() const {
  std::string settings;
  const auto add = [&](std::string_view name, const std::string& value) {
    settings += (settings.empty() ? "" : ", ") + std::string{name} + "=" + value;
  };
  for (const auto& [name, value] : settings_of(*this)) {
    // Settings that say nothing here: of other kernels, or left at "no limit".
    if (method == Method::svm && name == "gamma" && svm.kernel == Kernel::linear) continue;
    if (method == Method::svm && name == "degree" && svm.kernel != Kernel::polynomial) continue;
    if (method == Method::svm && name == "coef0" &&
        (svm.kernel == Kernel::linear || svm.kernel == Kernel::rbf || value == 0))
      continue;
    if (name == "epsilon_m" || name == "ridge" || name == "max_depth") continue;
    if (name == "features_per_split" && value == 0) continue;
    if (name == "interactions" && interactions) continue;
    if (name == "kernel")
      add(name, std::string{k_kernel_words.word(svm.kernel)});
    else
      add(name, number(value));
  }
  std::string out = engine == Engine::opencv ? "opencv " : "";
  out += method_name(method);
  if (!settings.empty()) out += "(" + settings + ")";
  if (method == Method::none || method == Method::constant) return out;
  if (features.size() == 1) return out + " of " + features.front();
  return out + " on " + std::to_string(features.size()) + " features";
}

Result<Classifier> fit_classifier(const Dataset& data, const Recipe& recipe, const Execution& run) {
  BOOST_OUTCOME_TRY(const auto p, prepare(data, recipe, true));
  Classifier out;
  out.scaler = p.scaler;
  const bool all = recipe.method == Method::average;
  if (all || recipe.method == Method::logistic) out.members.push_back({fit_logistic(p.rows(), recipe.c)});
  if (all || recipe.method == Method::svm) {
    BOOST_OUTCOME_TRY(auto member, svm_member(p, recipe, run));
    out.members.push_back(std::move(member));
  }
  if (all || recipe.method == Method::random_forest || recipe.method == Method::tree_average) {
    BOOST_OUTCOME_TRY(auto forest, fitted_forest(p, recipe, run));
    out.members.push_back({std::move(forest), true});
  }
  if (recipe.method == Method::boosted || recipe.method == Method::tree_average)
    out.members.push_back({fit_boosted(p.rows(), recipe.boosted, run)});
  if (run.cancelled()) return make_error(Errc::canceled, "cancelled");
  if (out.members.empty())
    return make_error(Errc::invalid_argument, std::string{method_name(recipe.method)} + " does not classify");
  return out;
}

Result<Regressor> fit_regressor(const Dataset& data, const Recipe& recipe, const Execution& run) {
  BOOST_OUTCOME_TRY(const auto p, prepare(data, recipe, false));
  Regressor out;
  out.scaler = p.scaler;
  if (recipe.method != Method::none) {
    std::vector<std::pair<double, double>> biases;
    for (std::size_t i = 0; i < p.y.size(); ++i) biases.emplace_back(p.y[i], p.data.weight[i]);
    out.fallback_m = weighted_median(std::move(biases));
  }
  switch (recipe.method) {
    case Method::none:
      out.scorer = Linear{};
      break;
    case Method::constant: {
      std::vector<std::pair<double, double>> values;
      for (std::size_t i = 0; i < p.y.size(); ++i) values.emplace_back(p.y[i], p.data.weight[i]);
      out.scorer = Linear{{}, weighted_median(std::move(values))};
      break;
    }
    case Method::random_forest: {
      BOOST_OUTCOME_TRY(out.scorer, fitted_forest(p, recipe, run));
      break;
    }
    case Method::boosted: {
      auto options = recipe.boosted;
      options.classification = false;
      out.scorer = fit_boosted(p.rows(), options, run);
      break;
    }
    case Method::svm: {
      BOOST_OUTCOME_TRY(out.scorer, fitted_svm(p, recipe, false, run));
      break;
    }
    case Method::univariate:
      out.scorer =
          fit_polynomial(p.rows(), polynomial_terms(p.data.columns(), recipe.degree, false), recipe.ridge);
      break;
    case Method::multivariate:
      out.scorer = fit_polynomial(
          p.rows(), polynomial_terms(p.data.columns(), recipe.degree, recipe.interactions), recipe.ridge);
      break;
    case Method::least_absolute:
      out.scorer = fit_least_absolute(p.rows(), 0.003);
      break;
    case Method::logistic:
    case Method::average:
    case Method::tree_average:
      return make_error(Errc::invalid_argument,
                        std::string{method_name(recipe.method)} + " does not regress");
  }
  if (run.cancelled()) return make_error(Errc::canceled, "cancelled");
  if (recipe.method != Method::none && recipe.method != Method::constant) {
    out.min_m = *std::min_element(p.y.begin(), p.y.end());
    out.max_m = *std::max_element(p.y.begin(), p.y.end());
  }
  return out;
}

std::vector<double> placement_weights(const Dataset& data) {
  std::map<std::uint32_t, double> count;
  for (const auto id : data.placement) count[id] += 1;
  std::vector<double> weight;
  for (std::size_t i = 0; i < data.rows(); ++i) weight.push_back(data.weight[i] / count[data.placement[i]]);
  return weight;
}

double worst_harm_m(const Dataset& data, std::span<const double> correction_m) {
  std::map<std::uint32_t, std::array<double, 3>> sums;  // rows, raw, corrected
  for (std::size_t i = 0; i < data.rows(); ++i) {
    auto& s = sums[data.group[i]];
    s[0] += 1;
    s[1] += std::abs(data.bias_m[i]);
    s[2] += std::abs(data.bias_m[i] - correction_m[i]);
  }
  double worst = 0;
  for (const auto& [group, s] : sums)
    if (s[0] >= 20) worst = std::max(worst, (s[2] - s[1]) / s[0]);
  return worst;
}

Result<OutOfFold> cross_validate(const Dataset& data, const Recipe& recipe,
                                 const std::vector<std::size_t>& fold, bool classification,
                                 const Execution& run) {
  BOOST_OUTCOME_TRY(const auto chosen, data.with_features(recipe.features));
  OutOfFold out;
  auto& answers = classification ? out.logit : out.bias_m;
  answers.resize(data.rows());
  const std::size_t folds = fold.empty() ? 0 : *std::max_element(fold.begin(), fold.end()) + 1;
  const Execution inner{1, run.stop};
  BOOST_OUTCOME_TRY(parallel_for(folds, run, [&](std::size_t k) -> Result<void> {
    const auto inside = rows_of_fold(fold, k, true), outside = rows_of_fold(fold, k, false);
    const Dataset train = chosen.subset(outside);
    if (classification) {
      BOOST_OUTCOME_TRY(const auto model, fit_classifier(train, recipe, inner));
      for (const auto i : inside) answers[i] = model.mean_logit(chosen.row(i));
    } else {
      BOOST_OUTCOME_TRY(const auto model, fit_regressor(train, recipe, inner));
      for (const auto i : inside) answers[i] = model.bias_m(chosen.row(i));
    }
    return boost::outcome_v2::success();
  }));
  const auto weight = placement_weights(data);
  std::vector<double> loss(data.rows());
  if (classification) {
    const std::vector<double> y(data.los.begin(), data.los.end());
    out.platt = fit_platt(out.logit, y, weight);
    for (std::size_t i = 0; i < data.rows(); ++i) {
      const double p = std::clamp(sigmoid(out.platt.slope * out.logit[i] + out.platt.offset), 0.01, 0.99);
      out.p_los.push_back(p);
      loss[i] = -std::log(data.los[i] ? p : 1 - p);
    }
  } else {
    for (std::size_t i = 0; i < data.rows(); ++i) loss[i] = std::abs(data.bias_m[i] - answers[i]);
    out.worst_harm_m = worst_harm_m(data, answers);
  }
  double sum = 0, total = 0, sum_folds = 0, sum_squares = 0;
  for (std::size_t k = 0; k < folds; ++k) {
    double s = 0, w = 0;
    for (std::size_t i = 0; i < data.rows(); ++i)
      if (fold[i] == k) {
        s += weight[i] * loss[i];
        w += weight[i];
      }
    sum += s;
    total += w;
    sum_folds += s / w;
    sum_squares += s / w * s / w;
    out.fold_loss.push_back(s / w);
  }
  const auto n = static_cast<double>(folds);
  out.loss = sum / total;
  out.loss_sd = std::sqrt(std::max(0.0, sum_squares / n - sum_folds / n * sum_folds / n));
  return out;
}

}  // namespace anchord::ml
