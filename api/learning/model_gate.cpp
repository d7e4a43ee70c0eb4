#include "api/learning/model_gate.hpp"

#include <algorithm>
#include <cstdio>

#include "core/ml/evaluate.hpp"

namespace anchord::api {
namespace {

/// The same figure twice may differ in its last digit.
constexpr double k_slack = 1e-9;

struct Figures {
  std::optional<double> accuracy{}, fpr{}, mae_m{}, mae_raw_m{};
  std::optional<double> commonest{};  ///< share of the more frequent class: what always saying it would reach
};

std::optional<double> metric(const ml::Model& model, std::string_view name) {
  for (const auto& [key, value] : model.info.metrics)
    if (key == name) return value;
  return std::nullopt;
}

Figures manifest_figures(const ml::Model& model) {
  return {metric(model, "accuracy"), metric(model, "fpr"), metric(model, "mae_m"), metric(model, "mae_raw_m"),
          std::nullopt};
}

Figures figures_on(const ml::Model& model, const ml::Dataset& rows) {
  const auto task = model.info.task;
  Figures out;
  const auto narrowed = rows.with_features(model.info.features);
  if (!narrowed) return out;  // the rows were chosen by the features of both models
  const auto e = ml::evaluate(model, narrowed.value());
  if (e.confusion && task == ml::Task::nlos_id) {
    out.accuracy = e.confusion->accuracy();
    if (e.confusion->fp + e.confusion->tn > 0) out.fpr = e.confusion->fpr();
    const auto los = static_cast<double>(e.confusion->tp + e.confusion->fn),
               nlos = static_cast<double>(e.confusion->fp + e.confusion->tn);
    if (los + nlos > 0) out.commonest = std::max(los, nlos) / (los + nlos);
  }
  if (e.all) {
    out.mae_m = e.all->corrected.mae_m;
    out.mae_raw_m = e.all->raw.mae_m;
  }
  return out;
}

struct Compared {
  Figures candidate{}, current{};
};

/// Both on the rows that have what either needs; nothing where there are too few of them.
std::optional<Compared> measured(const ml::Model& candidate, const ml::Model* current, const GateRows& on) {
  if (on.table == nullptr) return std::nullopt;
  DatasetTable test;
  test.registers = on.table->registers;
  for (const auto& row : on.table->rows)
    if (row.test && row.repeats == 1) test.rows.push_back(row);
  if (test.rows.empty()) return std::nullopt;
  const auto task = candidate.info.task;
  LearningWish wish{candidate.info.features, task != ml::Task::bias, task != ml::Task::nlos_id, {}, {}};
  if (current != nullptr)
    for (const auto& name : current->info.features)
      if (std::ranges::find(wish.features, name) == wish.features.end()) wish.features.push_back(name);
  if (task == ml::Task::los_bias) wish.only_los = true;
  if (task == ml::Task::nlos_bias) wish.only_los = false;
  const auto rows = learning_rows(test, wish);
  if (!rows || rows.value().source.size() < on.least_rows) return std::nullopt;
  return Compared{figures_on(candidate, rows.value().data),
                  current != nullptr ? figures_on(*current, rows.value().data) : Figures{}};
}

/// Cross-validated on the same rows and folds, so that what the manifests claim can be compared.
bool same_rows(const ml::ModelInfo& a, const ml::ModelInfo& b) {
  return a.data_digest == b.data_digest && a.rows == b.rows && a.group_by == b.group_by &&
         a.folds == b.folds && a.seed == b.seed;
}

std::string figure(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4f", value);
  return text;
}

}  // namespace

GateReport gate_of(const ml::Model& candidate, const ml::Model* current, const GateData& data) {
  Figures mine{}, theirs{};
  std::string basis = "none";
  for (const auto& on : data.rows) {
    const auto both = measured(candidate, current, on);
    if (!both) continue;
    mine = both->candidate;
    theirs = both->current;
    basis = on.basis;
    break;
  }
  bool apart = false;  // made here, but never measured on the rows the active one was
  if (basis == "none" && data.believe_manifest) {
    apart = current != nullptr && !same_rows(candidate.info, current->info);
    mine = manifest_figures(candidate);
    if (current != nullptr && !apart) theirs = manifest_figures(*current);
    basis = "manifest";
  }
  GateReport out;
  const auto fail = [&](GateCheck& check, const std::string& why) {
    check.passed = out.passed = false;
    out.why += (out.why.empty() ? "" : "; ") + why;
  };
  const auto no_worse = [&](const char* name, std::optional<double> a, std::optional<double> b) {
    if (!a) return;
    GateCheck check{name, a, b, true, basis};
    if (b && *a > *b + k_slack)
      fail(check, std::string(name) + " " + figure(*a) + " is worse than the " + figure(*b) +
                      " of the active model");
    out.checks.push_back(std::move(check));
  };
  if (!candidate.info.not_for_live.empty()) {
    GateCheck single{"single_ranges", std::nullopt, std::nullopt, true, "manifest"};
    fail(single, "the model is not for live ranges: " + candidate.info.not_for_live);
    out.checks.push_back(std::move(single));
  }
  if (apart) {
    GateCheck rows{"same_rows", std::nullopt, std::nullopt, true, "none"};
    fail(rows,
         "there are no rows of single ranges, unused in the training of both models, to compare it with the "
         "active model: freeze a "
         "data set with aggregation none that holds out places, or promote it with a reason");
    out.checks.push_back(std::move(rows));
  }
  if (basis == "none") {
    GateCheck evaluated{"evaluated", std::nullopt, std::nullopt, true, basis};
    fail(evaluated,
         "the model comes from another server, and no data set of this server has " +
             std::to_string(k_least_kept_rows) +
             " single ranges to evaluate it on: freeze one with other places, or promote it with a reason");
    out.checks.push_back(std::move(evaluated));
    return out;
  }
  if (candidate.info.task == ml::Task::nlos_id) {
    no_worse("fpr", mine.fpr, theirs.fpr);
    if (mine.commonest && !data.believe_manifest) {
      GateCheck helps{"helps", mine.accuracy, mine.commonest, true, basis};
      if (!mine.accuracy || *mine.accuracy < *mine.commonest + k_slack)
        fail(helps, "accuracy " + figure(mine.accuracy.value_or(0)) + " is no better than the " +
                        figure(*mine.commonest) + " of always predicting the same class");
      out.checks.push_back(std::move(helps));
    }
    if (mine.accuracy) out.checks.push_back({"accuracy", mine.accuracy, theirs.accuracy, true, basis});
    return out;
  }
  no_worse("mae_m", mine.mae_m, theirs.mae_m);
  GateCheck helps{"helps", mine.mae_m, mine.mae_raw_m, true, basis};
  if (!mine.mae_m || !mine.mae_raw_m)
    fail(helps, "nothing shows that the correction helps in places that were not used in training");
  else if (*mine.mae_m > *mine.mae_raw_m - k_slack)
    fail(helps, "MAE " + figure(*mine.mae_m) + " m is no better than the " + figure(*mine.mae_raw_m) +
                    " m without a correction");
  out.checks.push_back(std::move(helps));
  return out;
}

}  // namespace anchord::api
