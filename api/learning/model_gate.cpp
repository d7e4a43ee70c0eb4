#include "api/learning/model_gate.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <set>

#include "api/learning/gate_together.hpp"
#include "api/learning/split_leak.hpp"
#include "core/ml/evaluate.hpp"
#include "core/ml/plausible.hpp"

namespace anchord::api {
namespace {

/// The same figure twice may differ in its last digit.
constexpr double k_slack = 1e-9;
/// Of a Gaussian 0.95; errors of radios have heavier tails, and places differ.
constexpr double k_least_within95 = 0.8;

struct Figures {
  std::optional<double> accuracy{}, fpr{}, mae_m{}, mae_raw_m{};
  std::optional<double> balanced{};   ///< accuracy: mean of both classes' own; 0.5 is chance
  std::optional<double> commonest{};  ///< share of the more frequent class: what always saying it would reach
  std::optional<double> within95{};   ///< share of the errors within 1.96 of the sigmas claimed
};

std::optional<double> metric(const ml::Model& model, std::string_view name) {
  for (const auto& [key, value] : model.info.metrics)
    if (key == name) return value;
  return std::nullopt;
}

Figures manifest_figures(const ml::Model& model) {
  Figures out;
  out.accuracy = metric(model, "accuracy");
  out.fpr = metric(model, "fpr");
  out.mae_m = metric(model, "mae_m");
  out.mae_raw_m = metric(model, "mae_raw_m");
  out.balanced = metric(model, "balanced_accuracy");
  return out;
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
    if (los > 0 && nlos > 0) out.balanced = e.confusion->balanced_accuracy();
    if (los + nlos > 0) out.commonest = std::max(los, nlos) / (los + nlos);
  }
  if (e.all) {
    out.mae_m = e.all->corrected.mae_m;
    out.mae_raw_m = e.all->raw.mae_m;
    out.within95 = e.within95;
  }
  return out;
}

struct Compared {
  Figures candidate{}, current{};
};

enum class Side : std::uint8_t { test, train };

/// Both on the rows that have what either needs; nothing where there are too few of them.
/// learned  rows that the candidate has seen elsewhere
std::optional<Compared> measured(const ml::Model& candidate, const ml::Model* current, const GateRows& on,
                                 Side side = Side::test, const std::set<std::vector<double>>& learned = {}) {
  if (on.table == nullptr) return std::nullopt;
  DatasetTable test;
  test.registers = on.table->registers;
  // A held-out row that stands among the trained ones too, number by number, is not held out.
  const auto trained = side == Side::test ? trained_numbers(*on.table) : std::set<std::vector<double>>{};
  for (const auto& row : on.table->rows)
    if (row.test == (side == Side::test) && row.repeats == 1 && !trained.contains(numbers_of(row)) &&
        !learned.contains(numbers_of(row)))
      test.rows.push_back(row);
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

/// Name of the check that is helps in the candidate's own cross-validation.
constexpr const char* k_in_folds = "cross_validation";
std::string in_folds(std::string_view name) { return name == k_in_folds ? " in cross-validation" : ""; }

/// Collects checks, and in words what failed.
class Checks {
 public:
  GateReport out;

  void fail(GateCheck check, const std::string& why) {
    check.passed = out.passed = false;
    out.why += (out.why.empty() ? "" : "; ") + why;
    out.checks.push_back(std::move(check));
  }
  /// Nothing where the candidate has no such figure.
  void no_worse(const char* name, std::optional<double> a, std::optional<double> b, const std::string& basis,
                const std::string& where) {
    if (!a) return;
    GateCheck check{name, a, b, true, basis};
    if (b && *a > *b + k_slack)
      fail(std::move(check), std::string(name) + " " + figure(*a) + " is worse than the " + figure(*b) +
                                 " of the active model" + where);
    else
      out.checks.push_back(std::move(check));
  }
  /// Compared with chance, where both classes are there.
  void better_than_chance(const Figures& mine, const char* name, const std::string& basis) {
    if (!mine.balanced) return;
    GateCheck check{name, mine.balanced, 0.5, true, basis};
    const std::string where = in_folds(name);
    if (*mine.balanced < 0.5 + k_slack)
      fail(std::move(check),
           "balanced accuracy " + figure(*mine.balanced) + where + " is no better than chance");
    else
      out.checks.push_back(std::move(check));
  }
  /// Beside no correction.
  void corrects(const Figures& mine, const char* name, const std::string& basis) {
    GateCheck check{name, mine.mae_m, mine.mae_raw_m, true, basis};
    const std::string where = in_folds(name);
    if (!mine.mae_m || !mine.mae_raw_m)
      fail(std::move(check),
           "nothing shows that the correction helps in places that were not used in training");
    else if (*mine.mae_m > *mine.mae_raw_m - k_slack)
      fail(std::move(check), "MAE " + figure(*mine.mae_m) + " m" + where + " is no better than the " +
                                 figure(*mine.mae_raw_m) + " m without a correction");
    else
      out.checks.push_back(std::move(check));
  }
  /// A sigma that is too small makes every region it goes into too small.
  void honest_sigma(const Figures& mine, const std::string& basis) {
    if (!mine.within95) return;
    GateCheck check{"sigma", mine.within95, k_least_within95, true, basis};
    if (*mine.within95 < k_least_within95)
      fail(std::move(check), "only " + figure(*mine.within95) +
                                 " of the errors are within 1.96 of the sigmas that it claims, where 0.95 "
                                 "should be: the regions of anchors would be too small");
    else
      out.checks.push_back(std::move(check));
  }
  /// Beside always saying the same class.
  void helps(const Figures& mine, const std::string& basis, const std::string& where) {
    GateCheck check{"helps", mine.accuracy, mine.commonest, true, basis};
    if (!mine.accuracy || *mine.accuracy < *mine.commonest + k_slack)
      fail(std::move(check), "accuracy " + figure(mine.accuracy.value_or(0)) + " is no better than the " +
                                 figure(*mine.commonest) + " of always predicting the same class" + where);
    else
      out.checks.push_back(std::move(check));
  }
};

/// More than one training row in twenty that no radio measures is no accident.
constexpr double k_most_implausible = 0.05;

/// What no radio measures: ranges of another unit, or a correction that could never be applied.
void check_plausible(const ml::Model& candidate, const GateData& data, Checks& checks) {
  const auto task = candidate.info.task;
  if (task == ml::Task::nlos_id) return;
  std::size_t n = 0, implausible = 0;
  std::string example;
  for (std::size_t i = 0; data.own != nullptr && i < data.own->rows.size(); ++i) {
    const auto& row = data.own->rows[i];
    if (!row.true_range_m || !(row.range_m() > 0)) continue;
    if ((task == ml::Task::los_bias && row.los == false) || (task == ml::Task::nlos_bias && row.los == true))
      continue;
    ++n;
    if (ml::plausible_range(row.range_m(), row.range_m() - *row.true_range_m)) continue;
    if (implausible++ == 0)
      example = figure(row.range_m()) + " m at a true " + figure(*row.true_range_m) + " m";
  }
  const double share = n > 0 ? static_cast<double>(implausible) / static_cast<double>(n) : 0;
  GateCheck check{"plausible", share, k_most_implausible, true, "training_rows"};
  if (share > k_most_implausible)
    return checks.fail(std::move(check),
                       std::to_string(implausible) + " of the " + std::to_string(n) +
                           " rows it was trained on are no ranges of a radio in metres, for example " +
                           example + ": correct the unit or the true distances, and train again");
  const double usual_m = candidate.mixture     ? candidate.mixture->shared.centre_m
                         : candidate.regressor ? candidate.regressor->fallback_m
                                               : 0;
  if (std::abs(usual_m) > ml::k_most_correction_m)
    checks.fail({"plausible", std::abs(usual_m), ml::k_most_correction_m, true, "manifest"},
                "its usual correction is " + figure(usual_m) + " m, and none beyond " +
                    figure(ml::k_most_correction_m) + " m is applied: no radio errs by that much");
}

/// The candidate where the active model is at home.
void check_active_places(const ml::Model& candidate, const ml::Model* current, const GateData& data,
                         Checks& checks) {
  if (!data.active.asked || current == nullptr) return;
  const std::string basis = "active_places", where = " on the places of the active model";
  const auto learned = data.own != nullptr ? trained_numbers(*data.own) : std::set<std::vector<double>>{};
  auto both =
      measured(candidate, current, {data.active.table, basis, k_least_kept_rows}, Side::test, learned);
  if (!both && data.active.believe_manifest) {
    both = measured(candidate, current, {data.active.table, basis, k_least_kept_rows}, Side::train, learned);
    if (both) both->current = manifest_figures(*current);
  }
  const bool classes = candidate.info.task == ml::Task::nlos_id;
  if (!both || !(classes ? both->candidate.fpr : both->candidate.mae_m) ||
      !(classes ? both->current.fpr : both->current.mae_m))
    return checks.fail(
        {"places", std::nullopt, std::nullopt, true, "none"},
        "nothing shows how it does on the places of the active model: " +
            std::string(data.active.table == nullptr
                            ? "the data that one was trained on are not kept here"
                            : "its data have no ten single ranges with the features of both models that this "
                              "one was not trained on, or of one class alone") +
            "; freeze a data set that has them and train on it, or promote it with a reason");
  if (!classes) return checks.no_worse("mae_m", both->candidate.mae_m, both->current.mae_m, basis, where);
  checks.no_worse("fpr", both->candidate.fpr, both->current.fpr, basis, where);
  // One that calls everything NLOS is never wrong about NLOS.
  if (both->candidate.commonest && both->current.accuracy &&
      *both->current.accuracy > *both->candidate.commonest)
    checks.helps(both->candidate, basis, where);
}

/// So much worse may corrections be by chance.
constexpr double k_most_harm_m = 0.01;

/// The active corrections with the candidate's classes in place of those they have now.
void check_together(const ml::Model& candidate, const GateData& data, Checks& checks) {
  if (candidate.info.task != ml::Task::nlos_id) return;
  ml::ModelSet after = data.beside;
  after.nlos_id = std::make_shared<const ml::Model>(candidate);
  for (const auto& on : data.rows) {
    if (on.table == nullptr) continue;
    const auto both = corrected_together(data.beside, after, data.correction, *on.table,
                                         std::max<std::size_t>(on.least_rows, 1));
    if (!both) continue;
    GateCheck check{"with_corrections", both->mae_m, both->mae_before_m, true, on.basis};
    if (both->mae_m > both->mae_before_m + k_most_harm_m)
      checks.fail(std::move(check), "with its classes the active corrections leave a mean error of " +
                                        figure(both->mae_m) + " m, without it " + figure(both->mae_before_m) +
                                        " m");
    else
      checks.out.checks.push_back(std::move(check));
    return;
  }
}

struct Basis {
  std::string name;
  bool believe_manifest{};
};

/// What the candidate does where it was measured, and, of models made here, what cross-validation says of
/// it: a held-out part that is easy, or nearly that of the training, does not hide that.
void check_figures(const ml::Model& candidate, const Figures& mine, const Figures& theirs, const Basis& basis,
                   Checks& checks) {
  const bool folds_too = basis.believe_manifest && basis.name != "manifest";
  const Figures folds = folds_too ? manifest_figures(candidate) : Figures{};
  if (candidate.info.task != ml::Task::nlos_id) {
    checks.no_worse("mae_m", mine.mae_m, theirs.mae_m, basis.name, "");
    checks.corrects(mine, "helps", basis.name);
    if (folds.mae_m && folds.mae_raw_m) checks.corrects(folds, k_in_folds, "manifest");
    checks.honest_sigma(mine, basis.name);
    return;
  }
  checks.no_worse("fpr", mine.fpr, theirs.fpr, basis.name, "");
  // One that calls everything NLOS is never wrong about NLOS.
  const bool beaten = theirs.accuracy && mine.commonest && *theirs.accuracy > *mine.commonest;
  if (mine.commonest && (!basis.believe_manifest || beaten))
    checks.helps(mine, basis.name, "");
  else
    checks.better_than_chance(mine, "helps", basis.name);
  checks.better_than_chance(folds, k_in_folds, "manifest");
  if (mine.accuracy)
    checks.out.checks.push_back({"accuracy", mine.accuracy, theirs.accuracy, true, basis.name});
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
  Checks checks;
  if (!candidate.info.not_for_live.empty())
    checks.fail({"single_ranges", std::nullopt, std::nullopt, true, "manifest"},
                "the model is not for live ranges: " + candidate.info.not_for_live);
  if (apart)
    checks.fail({"same_rows", std::nullopt, std::nullopt, true, "none"},
                "there are no rows of single ranges, unused in the training of both models, to compare it "
                "with the active model: freeze a data set with aggregation none that holds out places, or "
                "promote it with a reason");
  if (basis == "none") {
    checks.fail({"evaluated", std::nullopt, std::nullopt, true, basis},
                "the model comes from another server, and no data set of this server has " +
                    std::to_string(k_least_kept_rows) +
                    " single ranges to evaluate it on: freeze one with other places, or promote it with a "
                    "reason");
    check_plausible(candidate, data, checks);
    check_active_places(candidate, current, data, checks);
    return checks.out;
  }
  check_figures(candidate, mine, theirs, {basis, data.believe_manifest}, checks);
  check_plausible(candidate, data, checks);
  check_active_places(candidate, current, data, checks);
  check_together(candidate, data, checks);
  return checks.out;
}

}  // namespace anchord::api
