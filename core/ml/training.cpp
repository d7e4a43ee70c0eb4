#include "core/ml/training.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>

#include "core/ml/random.hpp"

namespace anchord::ml {
namespace {

// Stages in their order, each with the share of the whole run it usually takes.
struct Stage {
  const char* name;
  double share;
};

class Reporter {
 public:
  Reporter(const ProgressSink& sink, std::vector<Stage> stages) : sink_{sink}, stages_{std::move(stages)} {
    for (const auto& stage : stages_) whole_ += stage.share;
  }

  void enter(const char* name) {
    while (at_ < stages_.size() && std::string_view{stages_[at_].name} != name)
      before_ += stages_[at_++].share;
    report(0, "");
  }

  void report(double share_of_stage, const std::string& detail) {
    if (!sink_ || at_ >= stages_.size()) return;
    const auto& stage = stages_[at_];
    most_ = std::max(most_, (before_ + stage.share * std::clamp(share_of_stage, 0.0, 1.0)) / whole_);
    sink_({stage.name, at_, stages_.size(), most_, detail});
  }

 private:
  const ProgressSink& sink_;
  std::vector<Stage> stages_;
  std::size_t at_{0};
  double before_{0}, whole_{0}, most_{0};
};

std::vector<std::vector<std::string>> places_of_folds(const Dataset& data,
                                                      const std::vector<std::size_t>& fold) {
  std::vector<std::set<std::uint32_t>> ids;
  for (std::size_t i = 0; i < fold.size(); ++i) {
    if (fold[i] >= ids.size()) ids.resize(fold[i] + 1);
    ids[fold[i]].insert(data.group[i]);
  }
  std::vector<std::vector<std::string>> out;
  for (const auto& places : ids) {
    out.emplace_back();
    // Rows as places would name every row: enough is enough.
    for (const auto id : places)
      if (out.back().size() < 1000) out.back().push_back(place_name(data, id));
  }
  return out;
}

std::vector<RowPrediction> predictions_of(const Dataset& data, const PlaceSplit& split,
                                          const Learned& learned) {
  std::vector<RowPrediction> out;
  for (std::size_t k = 0; k < split.train.size(); ++k) {
    RowPrediction p{split.train[k], false, {}, {}, {}, {}};
    if (data.labelled()) p.los = data.los[p.row] != 0;
    if (!learned.p_los.empty()) p.p_los = learned.p_los[k];
    if (data.has_truth()) p.bias_m = data.bias_m[p.row];
    if (!learned.correction_m.empty()) p.correction_m = learned.correction_m[k];
    out.push_back(p);
  }
  return out;
}

void add_test(const Dataset& data, const PlaceSplit& split, TrainingOutcome& out) {
  const auto narrowed = data.subset(split.test).with_features(out.model.info.features);
  if (!narrowed) return;  // the model's features come from these data
  out.test = evaluate(out.model, narrowed.value());
  for (std::size_t k = 0; k < split.test.size(); ++k) {
    RowPrediction p{split.test[k], true, {}, {}, {}, {}};
    const auto answer = predict(out.model, narrowed.value().row(k));
    if (data.labelled()) p.los = data.los[p.row] != 0;
    p.p_los = answer.p_los;
    if (data.has_truth()) p.bias_m = data.bias_m[p.row];
    p.correction_m = answer.bias_m;
    out.predictions.push_back(p);
  }
}

void add_curves(const Dataset& train, const Learned& learned, const TrainingSpec& spec,
                TrainingOutcome& out) {
  if (!learned.p_los.empty() && train.labelled()) {
    const double threshold = out.model.classifier ? out.model.classifier->threshold : 0.5;
    out.confusion = confusion_at(learned.p_los, train.los, threshold);
    out.roc = roc(learned.p_los, train.los);
    out.auc = area_under(out.roc);
    out.threshold = threshold_report(train, learned.p_los, threshold, spec.max_fpr, spec.seed);
  }
  if (learned.correction_m.empty()) return;
  std::vector<double> left;
  for (std::size_t i = 0; i < train.rows(); ++i) left.push_back(train.bias_m[i] - learned.correction_m[i]);
  out.bias = BiasEvaluation{error_stats(train.bias_m), error_stats(left)};
  out.cdf_raw = cdf_of_magnitude(train.bias_m);
  out.cdf_corrected = cdf_of_magnitude(left);
  out.nll = learned.nll;
  out.nll_constants = learned.nll_constants;
}

// The forest that ranks features: on all of them, whatever was picked.
Recipe ranking_forest(const Dataset& data, const TrainingSpec& spec) {
  Recipe r;
  r.method = Method::random_forest;
  r.features = spec.features.empty() ? data.features : spec.features;
  if (r.features.size() > k_max_features) r.features.resize(k_max_features);
  r.clip = 0;
  r.per_placement = spec.per_placement;
  r.forest.seed = spec.seed;
  r.forest.trees = 60;
  return r;
}

// What the pick is compared by: negative log-likelihood of a mixture, else the loss of its row in the table.
double loss_of(const Learned& learned) {
  if (learned.model.mixture) return learned.nll;
  for (const auto& row : learned.table)
    if (row.picked) return row.loss;
  return learned.nll;
}

// Log losses and likelihoods closer than this are noise on a few hundred placements, MAE by its share.
constexpr double k_tie_log_loss = 0.01, k_tie_share = 0.01;

// The features that the filter kept compete with those of the pick: with fewer features, a tie is enough. The
// winner is what `learned` becomes, and its manifest says which it was.
Result<void> try_selection(const Dataset& data, LearnOptions options, const std::vector<ForwardStep>& steps,
                           Learned& learned) {
  options.features.clear();
  for (const auto& step : steps)
    if (step.kept) options.features.push_back(step.feature);
  const std::size_t before = learned.model.info.features.size(), after = options.features.size();
  if (after == 0 || after >= before) return boost::outcome_v2::success();
  BOOST_OUTCOME_TRY(auto fewer, learn(data, options));
  const double whole = loss_of(learned), less = loss_of(fewer);
  const bool by_share = !learned.model.mixture && options.task != Task::nlos_id;
  const bool followed = less <= whole + (by_share ? k_tie_share * whole : k_tie_log_loss);
  for (auto& row : fewer.folds) row.candidate += learned.table.size();
  for (auto& row : followed ? learned.table : fewer.table) row.picked = false;
  learned.table.insert(learned.table.end(), fewer.table.begin(), fewer.table.end());
  learned.folds.insert(learned.folds.end(), fewer.folds.begin(), fewer.folds.end());
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(), "; the feature filter keeps %zu of %zu: loss %.3f against %.3f, %s",
                after, before, less, whole, followed ? "so the model uses them" : "so it is not followed");
  if (followed) {
    fewer.table = std::move(learned.table);
    fewer.folds = std::move(learned.folds);
    learned = std::move(fewer);
  }
  learned.model.info.why += text.data();
  return boost::outcome_v2::success();
}

}  // namespace

Result<PlaceSplit> split_places(const Dataset& data, const std::vector<std::string>& held_out,
                                double held_out_share, std::uint64_t seed) {
  const std::set<std::uint32_t> all(data.group.begin(), data.group.end());
  std::set<std::uint32_t> held;
  for (const auto& name : held_out) {
    const std::size_t before = held.size();
    for (const auto id : all)
      if (place_name(data, id) == name) held.insert(id);
    if (held.size() == before) return make_error(Errc::not_found, "no place named " + name + " to hold out");
  }
  if (held_out.empty() && held_out_share > 0) {
    std::vector<std::uint32_t> order(all.begin(), all.end());
    Random random{seed ^ 0x5EED5EEDULL};  // another draw than the folds'
    random.shuffle(order);
    const auto n =
        static_cast<std::size_t>(std::ceil(held_out_share * static_cast<double>(order.size()) - 1e-9));
    held.insert(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(std::min(n, order.size())));
  }
  PlaceSplit out;
  for (std::size_t i = 0; i < data.rows(); ++i)
    (held.contains(data.group[i]) ? out.test : out.train).push_back(i);
  if (out.train.empty())
    return make_error(Errc::too_few_observations, "every place is held out: nothing is left to train on");
  return out;
}

Result<void> TrainingSpec::check() const {
  std::string faults;
  const auto fault = [&faults](const std::string& text) { faults += (faults.empty() ? "" : "; ") + text; };
  if (folds < 2 || folds > 1000) fault("folds must be 2 to 1000, is " + std::to_string(folds));
  if (per_placement < 1) fault("per_placement must be at least 1");
  if (!(held_out_share >= 0 && held_out_share < 1)) fault("held_out_share must be 0 to below 1");
  if (max_fpr && !(*max_fpr >= 0 && *max_fpr <= 1)) fault("max_fpr must be 0 to 1");
  if (features.size() > k_max_features) fault("at most 64 features");
  std::string able;
  for (const auto& [word, method] : k_method_words)
    if (suits(method, task)) able += (able.empty() ? "" : ", ") + std::string{word};
  for (const auto method : methods)
    if (!suits(method, task))
      fault(std::string{method_name(method)} + " cannot learn " + std::string{task_name(task)} +
            "; the methods that can are " + able + ", or auto");
  for (const auto method : methods)
    if (!fits(engine, method))
      fault("engine " + std::string{engine_name(engine)} + " has no " + std::string{method_name(method)} +
            ": it fits svm and random_forest");
  std::size_t points = 0;
  for (const auto& [method, axes] : grid) {
    const auto known = grid_settings(method);
    std::size_t product = 1;
    for (const auto& [name, values] : axes) {
      if (std::find(known.begin(), known.end(), name) == known.end())
        fault(std::string{method_name(method)} + " has no setting " + name);
      if (values.empty()) fault("no values for " + name + " of " + std::string{method_name(method)});
      for (const double v : values)
        if (!std::isfinite(v) || v < 0 || v > 1e6) fault(name + " must be 0 to 1000000");
      product *= std::max<std::size_t>(values.size(), 1);
      if (product > 10'000) break;
    }
    points += product;
  }
  if (points > 10'000) fault("the grid has more than 10000 points");
  if (!faults.empty()) return make_error(Errc::invalid_argument, faults);
  return boost::outcome_v2::success();
}

Result<void> TrainingSpec::check_size(std::size_t rows) const {
  double row_fits = 0, settings = 0;
  std::vector<Method> tried = methods;
  if (tried.empty()) tried.push_back(task == Task::nlos_id ? Method::average : Method::multivariate);
  for (const auto method : tried) {
    const auto own = grid.find(method);
    double points = 1;
    for (const auto& [name, values] : own != grid.end() ? own->second
                                      : search          ? default_grid(method, task == Task::nlos_id)
                                                        : std::map<std::string, std::vector<double>>{})
      points *= static_cast<double>(std::max<std::size_t>(values.size(), 1));
    const std::size_t fitted = method == Method::svm ? std::min(rows, most_svm_rows(engine)) : rows;
    settings += points;
    row_fits += points * static_cast<double>(folds) * static_cast<double>(fitted);
  }
  if (row_fits <= k_most_row_fits) return boost::outcome_v2::success();
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "%.0f settings x %zu folds on %zu rows are %.2g row fits, more than the %.0e that finish "
                "within hours: use a smaller grid, fewer folds, or a data set of fewer rows",
                settings, folds, rows, row_fits, k_most_row_fits);
  return make_error(Errc::invalid_argument, text.data());
}

Result<TrainingOutcome> train(const Dataset& data, const TrainingSpec& spec, std::stop_token stop,
                              const ProgressSink& progress) {
  BOOST_OUTCOME_TRY(spec.check());
  BOOST_OUTCOME_TRY(spec.check_size(data.rows()));
  std::vector<Stage> stages{{"split", 1}, {"search", 80}};
  if (spec.importance) stages.push_back({"importance", 8});
  if (spec.selection) stages.push_back({"selection", 20});
  stages.push_back({"test", 1});
  Reporter reporter{progress, std::move(stages)};
  const Execution run{spec.threads, stop};

  reporter.enter("split");
  BOOST_OUTCOME_TRY(const auto split, split_places(data, spec.held_out, spec.held_out_share, spec.seed));
  TrainingOutcome out;
  out.split = split_report(data, split.train, split.test);
  const Dataset train_set = data.subset(split.train);

  reporter.enter("search");
  LearnOptions options{spec.task,          spec.methods, spec.engine, spec.features, spec.folds, spec.seed,
                       spec.per_placement, spec.search,  spec.grid,   spec.max_fpr,  run,        {}};
  options.progress = [&reporter](double share, const std::string& detail) { reporter.report(share, detail); };
  BOOST_OUTCOME_TRY(auto learned, learn(train_set, options));
  const bool classification = spec.task == Task::nlos_id || (spec.task == Task::bias && data.labelled());
  if (spec.importance) {
    reporter.enter("importance");
    BOOST_OUTCOME_TRY(out.importance,
                      permutation_importance(train_set, ranking_forest(data, spec), classification, 5, run));
  }
  if (spec.selection) {
    reporter.enter("selection");
    std::vector<std::string> order;
    auto ranking = out.importance;
    if (ranking.empty()) {
      BOOST_OUTCOME_TRY(
          ranking, permutation_importance(train_set, ranking_forest(data, spec), classification, 5, run));
    }
    for (const auto& one : ranking) order.push_back(one.feature);
    BOOST_OUTCOME_TRY(out.selection, forward_filter(train_set, learned.picked, order, learned.fold,
                                                    classification, 0.002, run));
    BOOST_OUTCOME_TRY(try_selection(train_set, options, out.selection, learned));
  }
  out.model = std::move(learned.model);
  out.candidates = std::move(learned.table);
  out.class_candidates = std::move(learned.class_table);
  out.folds = std::move(learned.folds);
  out.fold_places = places_of_folds(train_set, learned.fold);
  out.predictions = predictions_of(data, split, learned);
  add_curves(train_set, learned, spec, out);
  reporter.enter("test");
  if (!split.test.empty()) add_test(data, split, out);
  if (run.cancelled()) return make_error(Errc::canceled, "cancelled");
  reporter.report(1, "");
  return out;
}

}  // namespace anchord::ml
