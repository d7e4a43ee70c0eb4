#include "api/learning/model_gate.hpp"

#include <algorithm>
#include <cstdio>

#include "core/ml/evaluate.hpp"

namespace anchord::api {
namespace {

/// The same figure twice may differ in its last digit.
constexpr double k_slack = 1e-9;

/// Fewer rows tell nothing of a model that nobody here has seen.
constexpr std::size_t k_least_rows = 10;

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

std::optional<Figures> measured(const ml::Model& model, const DatasetTable& table, std::size_t least_rows) {
  DatasetTable test;
  for (const auto& row : table.rows)
    if (row.test) test.rows.push_back(row);
  if (test.rows.empty()) return std::nullopt;
  const auto task = model.info.task;
  LearningWish wish{model.info.features, task != ml::Task::bias, task != ml::Task::nlos_id, {}, {}};
  if (task == ml::Task::los_bias) wish.only_los = true;
  if (task == ml::Task::nlos_bias) wish.only_los = false;
  const auto rows = learning_rows(test, wish);
  if (!rows || rows.value().source.size() < least_rows) return std::nullopt;
  const auto e = ml::evaluate(model, rows.value().data);
  Figures out;
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

std::string figure(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4f", value);
  return text;
}

}  // namespace

GateReport gate_of(const ml::Model& candidate, const ml::Model* current, const GateData& data) {
  Figures mine{}, theirs{};
  std::string basis = "none";
  if (data.believe_manifest) {
    mine = manifest_figures(candidate);
    if (current != nullptr) theirs = manifest_figures(*current);
    basis = "manifest";
  }
  if (data.held_out != nullptr) {
    const std::size_t least = data.believe_manifest ? 1 : k_least_rows;
    const auto a = measured(candidate, *data.held_out, least);
    const auto b = current ? measured(*current, *data.held_out, least) : std::optional<Figures>(Figures{});
    if (a && b) mine = *a, theirs = *b, basis = data.basis;
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
  if (basis == "none") {
    GateCheck evaluated{"evaluated", std::nullopt, std::nullopt, true, basis};
    fail(evaluated, "the model is from elsewhere, and no data set of this server has " +
                        std::to_string(k_least_rows) +
                        " rows to evaluate it on: freeze one with other places, or promote it with a reason");
    out.checks.push_back(std::move(evaluated));
    return out;
  }
  if (candidate.info.task == ml::Task::nlos_id) {
    no_worse("fpr", mine.fpr, theirs.fpr);
    if (mine.commonest && !data.believe_manifest) {
      GateCheck helps{"helps", mine.accuracy, mine.commonest, true, basis};
      if (!mine.accuracy || *mine.accuracy < *mine.commonest + k_slack)
        fail(helps, "accuracy " + figure(mine.accuracy.value_or(0)) + " is no better than the " +
                        figure(*mine.commonest) + " of always saying the same class");
      out.checks.push_back(std::move(helps));
    }
    if (mine.accuracy) out.checks.push_back({"accuracy", mine.accuracy, theirs.accuracy, true, basis});
    return out;
  }
  no_worse("mae_m", mine.mae_m, theirs.mae_m);
  GateCheck helps{"helps", mine.mae_m, mine.mae_raw_m, true, basis};
  if (!mine.mae_m || !mine.mae_raw_m)
    fail(helps, "nothing shows that the correction helps in places it has not seen");
  else if (*mine.mae_m > *mine.mae_raw_m - k_slack)
    fail(helps, "MAE " + figure(*mine.mae_m) + " m is no better than the " + figure(*mine.mae_raw_m) +
                    " m without a correction");
  out.checks.push_back(std::move(helps));
  return out;
}

}  // namespace anchord::api
