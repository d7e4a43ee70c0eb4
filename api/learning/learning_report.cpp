#include "api/learning/learning_report.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "api/formats/cells.hpp"
#include "api/learning/training_parts.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

Ordered json_of(const ml::Confusion& c) { return {{"tp", c.tp}, {"fp", c.fp}, {"fn", c.fn}, {"tn", c.tn}}; }

Ordered json_of(const RowReport& r) {
  Ordered dropped = Ordered::array();
  for (const auto& [reason, entry] : r.dropped) {
    Ordered item{{"reason", reason}, {"count", entry.first}};
    if (!entry.second.empty()) item["first"] = entry.second;
    dropped.push_back(item);
  }
  Ordered out{{"files", r.files}, {"rows_read", r.read}, {"rows_used", r.used}, {"dropped", dropped}};
  const auto text = [](const std::string& s) { return s.empty() ? Ordered(nullptr) : Ordered(s); };
  out["columns"] = {{"label", text(r.label)},
                    {"truth", text(r.truth)},
                    {"group_by", text(r.group_by)},
                    {"placement", text(r.placement)}};
  out["columns"]["los_value"] = text(r.los_value);
  out["columns"]["unused"] = r.unused;
  if (!r.warning.empty()) out["warning"] = r.warning;
  if (!r.warnings.empty()) out["warnings"] = r.warnings;
  return out;
}

void put_confusion(Ordered& out, const ml::Confusion& c) {
  out["accuracy"] = c.accuracy();
  out["balanced_accuracy"] = c.balanced_accuracy();
  out["fpr"] = c.fpr();
  out["fnr"] = c.fnr();
  out["confusion"] = json_of(c);
}

std::string format(const char* pattern, auto... values) {
  std::array<char, 512> text{};
  std::snprintf(text.data(), text.size(), pattern, values...);
  return text.data();
}

std::string text_of(const RowReport& r) {
  std::string out = format("rows: %zu read, %zu used", r.read, r.used);
  for (const auto& [reason, entry] : r.dropped)
    out += format("\n  dropped %zu: %s%s%s", entry.first, reason.c_str(),
                  entry.second.empty() ? "" : ", first ", entry.second.c_str());
  if (!r.label.empty() && !r.los_value.empty())
    out += "\nclass: " + r.los_value + " of column " + r.label + " is LOS";
  if (!r.group_by.empty()) out += "\nplaces by: " + r.group_by;
  if (const auto unused = listed_briefly(r.unused); !unused.empty()) out += "\ncolumns not used: " + unused;
  if (!r.warning.empty()) out += "\nwarning: " + r.warning;
  for (const auto& warning : r.warnings) out += "\nwarning: " + warning;
  return out + "\n";
}

std::string text_row(const char* name, const ml::BiasEvaluation& b) {
  return format("  %-6s %7zu  raw %.3f m  corrected %.3f m  (%+.1f %%)   MSE %.4f -> %.4f m2\n", name,
                b.raw.n, b.raw.mae_m, b.corrected.mae_m,
                100 * ml::improvement(b.raw.mae_m, b.corrected.mae_m), b.raw.mse_m2, b.corrected.mse_m2);
}

}  // namespace

namespace {

Ordered settings_json(const std::vector<std::pair<std::string, double>>& settings) {
  Ordered out = Ordered::object();
  for (const auto& [name, value] : settings) out[name] = value;
  return out;
}

Ordered candidates_json(const std::vector<ml::CandidateRow>& table, bool bias) {
  Ordered out = Ordered::array();
  for (const auto& row : table) {
    Ordered entry{{"candidate", row.name},
                  {"picked", row.picked},
                  {"method", ml::method_name(row.method)},
                  {"settings", settings_json(row.settings)},
                  {"features", row.features}};
    if (bias) {
      entry["mae_m"] = row.error.mae_m;
      entry["mse_m2"] = row.error.mse_m2;
      entry["worst_place_harm_m"] = row.worst_harm_m;
      entry["mae_improvement"] = ml::improvement(table.front().error.mae_m, row.error.mae_m);
    } else {
      put_confusion(entry, row.confusion);
      entry["brier"] = row.brier;
      entry["log_loss"] = row.loss;
      entry["log_loss_sd"] = row.loss_sd;
    }
    out.push_back(entry);
  }
  return out;
}

Ordered folds_json(const ml::TrainingOutcome& outcome, bool bias) {
  Ordered out = Ordered::array();
  for (const auto& row : outcome.folds) {
    Ordered entry{{"candidate", row.candidate},
                  {"fold", row.fold},
                  {"train_rows", row.train_rows},
                  {"test_rows", row.test_rows},
                  {"loss", row.loss}};
    if (bias) {
      entry["mae_raw_m"] = row.mae_raw_m;
      entry["mae_m"] = row.mae_m;
    } else
      put_confusion(entry, row.confusion);
    out.push_back(entry);
  }
  return out;
}

Ordered split_json(const ml::SplitReport& s) {
  return {
      {"train", {{"rows", s.train_rows}, {"placements", s.train_placements}, {"places", s.train_places}}},
      {"test", {{"rows", s.test_rows}, {"placements", s.test_placements}, {"places", s.test_place_names}}},
      {"shared_placements", s.shared_placements},
      {"duplicate_rows", s.duplicate_rows},
      {"leak", s.leak}};
}

Ordered threshold_json(const ml::ThresholdReport& t) {
  Ordered out{{"threshold", t.threshold},    {"fpr", t.fpr},
              {"fpr_low", t.fpr_low},        {"fpr_high", t.fpr_high},
              {"accuracy", t.accuracy},      {"accuracy_at_half", t.accuracy_at_half},
              {"places_with_nlos", t.places}};
  if (t.max_fpr) out["max_fpr"] = *t.max_fpr;
  return out;
}

Ordered test_json(const ml::Evaluation& e) {
  Ordered out{{"n", e.rows}};
  if (e.confusion) {
    put_confusion(out, *e.confusion);
    out["brier"] = e.brier;
    out["log_loss"] = e.log_loss;
    out["roc_auc"] = e.roc_auc;
  }
  if (e.all) out["bias"] = {{"all", bias_json(*e.all)}};
  if (e.los) out["bias"]["los"] = bias_json(*e.los);
  if (e.nlos) out["bias"]["nlos"] = bias_json(*e.nlos);
  if (e.nll) out["mean_negative_log_likelihood"] = *e.nll;
  return out;
}

}  // namespace

std::string train_json(const ml::TrainingOutcome& outcome, const RowReport& rows,
                       const std::string& out_path) {
  const auto& info = outcome.model.info;
  Ordered out{{"model", out_path},          {"task", ml::task_name(info.task)},
              {"method", info.method},      {"why", info.why},
              {"features", info.features},  {"data", json_of(rows)},
              {"digest", info.data_digest}, {"placements", info.placements},
              {"places", info.groups},      {"folds", info.folds},
              {"seed", info.seed}};
  Ordered cv = Ordered::object();
  for (const auto& [name, value] : info.metrics) cv[name] = value;
  out["cross_validation"] = cv;
  const bool bias = info.task != ml::Task::nlos_id;
  out["candidates"] = candidates_json(outcome.candidates, bias);
  if (!outcome.class_candidates.empty())
    out["class_candidates"] = candidates_json(outcome.class_candidates, false);
  if (!outcome.folds.empty()) out["fold_results"] = folds_json(outcome, bias);
  out["split"] = split_json(outcome.split);
  if (outcome.model.classifier) out["threshold"] = outcome.model.classifier->threshold;
  if (outcome.threshold) out["threshold_report"] = threshold_json(*outcome.threshold);
  if (!outcome.importance.empty()) {
    Ordered list = Ordered::array();
    for (const auto& one : outcome.importance)
      list.push_back({{"feature", one.feature}, {"mean", one.mean}, {"sd", one.sd}});
    out["importance"] = list;
  }
  if (!outcome.selection.empty()) {
    Ordered list = Ordered::array();
    for (const auto& one : outcome.selection)
      list.push_back({{"feature", one.feature}, {"loss", one.loss}, {"kept", one.kept}});
    out["selection"] = list;
  }
  if (outcome.test) out["test"] = test_json(*outcome.test);
  return to_wire(out, 2) + "\n";
}

std::string train_text(const ml::TrainingOutcome& outcome, const RowReport& rows,
                       const std::string& out_path) {
  const auto& info = outcome.model.info;
  std::string out = text_of(rows);
  out += format("%zu placements in %zu places, %zu folds of whole places, seed %llu\n\n", info.placements,
                info.groups, info.folds, static_cast<unsigned long long>(info.seed));
  const bool bias = info.task != ml::Task::nlos_id;
  out += bias ? format("   %-52s %8s %9s %12s\n", "on held-out places", "MAE m", "MSE m2", "worst harm m")
              : format("   %-52s %8s %7s %7s %9s %7s\n", "on held-out places", "accuracy", "FPR", "FNR",
                       "log loss", "Brier");
  for (const auto& row : outcome.candidates) {
    out += bias ? format(" %s %-52s %8.3f %9.4f %+12.3f\n", row.picked ? "*" : " ", row.name.c_str(),
                         row.error.mae_m, row.error.mse_m2, row.worst_harm_m)
                : format(" %s %-52s %8.3f %7.3f %7.3f %9.3f %7.3f\n", row.picked ? "*" : " ",
                         row.name.c_str(), row.confusion.accuracy(), row.confusion.fpr(), row.confusion.fnr(),
                         row.loss, row.brier);
  }
  out += "\npicked: " + info.why + "\n";
  if (outcome.threshold) {
    const auto& t = *outcome.threshold;
    out +=
        format("threshold %.3f: FPR %.3f (95 %% of resampled places %.3f to %.3f, %zu places), accuracy %.3f",
               t.threshold, t.fpr, t.fpr_low, t.fpr_high, t.places, t.accuracy);
    out += t.threshold == 0.5 ? "\n" : format(", at 0.5 it is %.3f\n", t.accuracy_at_half);
  }
  if (!outcome.importance.empty()) {
    out += "importance (rise of the error when shuffled):";
    for (std::size_t i = 0; i < std::min<std::size_t>(8, outcome.importance.size()); ++i)
      out += format(" %s %.3f", outcome.importance[i].feature.c_str(), outcome.importance[i].mean);
    out += "\n";
  }
  if (!outcome.selection.empty()) {
    out += "forward filter kept:";
    for (const auto& step : outcome.selection)
      if (step.kept) out += " " + step.feature;
    out += "\n";
  }
  if (outcome.split.leak)
    out += format("warning: %zu placements in more than one place, %zu rows equal to rows of other places\n",
                  outcome.split.shared_placements, outcome.split.duplicate_rows);
  if (outcome.test) {
    out += format("held out: %zu rows of %zu places", outcome.test->rows, outcome.split.test_places);
    if (outcome.test->confusion)
      out += format(", accuracy %.3f, FPR %.3f", outcome.test->confusion->accuracy(),
                    outcome.test->confusion->fpr());
    if (outcome.test->all)
      out += format(", MAE %.3f m raw, %.3f m corrected", outcome.test->all->raw.mae_m,
                    outcome.test->all->corrected.mae_m);
    out += "\n";
  }
  out += "model: " + out_path + "\n";
  return out;
}

std::string evaluation_json(const ml::Evaluation& e, const ml::Model& model, const RowReport& rows) {
  Ordered out{{"task", ml::task_name(model.info.task)}, {"method", model.info.method}, {"n", e.rows}};
  if (e.confusion) {
    put_confusion(out, *e.confusion);
    out["threshold"] = model.classifier->threshold;
    out["brier"] = e.brier;
    out["log_loss"] = e.log_loss;
    out["roc_auc"] = e.roc_auc;
  }
  if (e.all) {
    out["mae_raw_m"] = e.all->raw.mae_m;
    out["mae_m"] = e.all->corrected.mae_m;
    out["mse_raw_m2"] = e.all->raw.mse_m2;
    out["mse_m2"] = e.all->corrected.mse_m2;
    out["bias"] = {{"all", bias_json(*e.all)}};
    if (e.los) out["bias"]["los"] = bias_json(*e.los);
    if (e.nlos) out["bias"]["nlos"] = bias_json(*e.nlos);
    if (e.nll) out["mean_negative_log_likelihood"] = *e.nll;
    Ordered cdf = Ordered::array();
    for (std::size_t i = 0; i < e.cdf_raw.size(); i += 5)
      cdf.push_back({{"share", e.cdf_raw[i].share},
                     {"raw_m", e.cdf_raw[i].value_m},
                     {"corrected_m", e.cdf_corrected[i].value_m}});
    out["cdf"] = cdf;
  }
  if (!e.roc.empty()) {
    Ordered roc = Ordered::array();
    const std::size_t step = std::max<std::size_t>(1, e.roc.size() / 100);
    for (std::size_t i = 0; i < e.roc.size(); ++i)
      if (i % step == 0 || i + 1 == e.roc.size())
        roc.push_back({{"threshold", e.roc[i].threshold}, {"fpr", e.roc[i].fpr}, {"tpr", e.roc[i].tpr}});
    out["roc"] = roc;
  }
  Ordered places = Ordered::array();
  for (const auto& place : e.places) {
    Ordered entry{{"place", place.place}, {"n", place.rows}};
    if (place.accuracy) entry["accuracy"] = *place.accuracy;
    if (place.bias) {
      entry["mae_raw_m"] = place.bias->raw.mae_m;
      entry["mae_m"] = place.bias->corrected.mae_m;
    }
    places.push_back(entry);
  }
  out["places"] = places;
  out["data"] = json_of(rows);
  return to_wire(out, 2) + "\n";
}

std::string evaluation_text(const ml::Evaluation& e, const ml::Model& model, const RowReport& rows) {
  std::string out = text_of(rows);
  out += "model: " + std::string{ml::task_name(model.info.task)} + ", " + model.info.method + "\n";
  if (e.confusion) {
    const auto& c = *e.confusion;
    out += format(
        "accuracy %.4f   balanced %.4f   FPR (NLOS called LOS) %.4f   FNR %.4f   Brier %.4f   ROC area "
        "%.4f\n",
        c.accuracy(), c.balanced_accuracy(), c.fpr(), c.fnr(), e.brier, e.roc_auc);
    out += format("  LOS: %.0f right, %.0f called NLOS;  NLOS: %.0f right, %.0f called LOS\n", c.tp, c.fn,
                  c.tn, c.fp);
  }
  if (e.all) {
    out += "range bias (mean absolute error; raw is no correction)\n" + text_row("all", *e.all);
    if (e.los) out += text_row("LOS", *e.los);
    if (e.nlos) out += text_row("NLOS", *e.nlos);
    if (e.nll) out += format("  mean negative log-likelihood %.3f\n", *e.nll);
  }
  return out;
}

}  // namespace anchord::api
