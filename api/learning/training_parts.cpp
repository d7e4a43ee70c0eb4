#include "api/learning/training_parts.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

using Ordered = nlohmann::ordered_json;

Ordered confusion_json(const ml::Confusion& c) {
  return {{"tp", c.tp}, {"fp", c.fp}, {"fn", c.fn}, {"tn", c.tn}};
}

Ordered rates_json(const ml::Confusion& c) {
  return {{"accuracy", c.accuracy()},
          {"balanced_accuracy", c.balanced_accuracy()},
          {"fpr", c.fpr()},
          {"fnr", c.fnr()},
          {"confusion", confusion_json(c)}};
}

struct FoldSpread {
  double sum{}, square{};
  std::size_t n{};
  void add(double v) {
    sum += v;
    square += v * v;
    ++n;
  }
  Ordered json() const {
    if (n == 0) return nullptr;
    const auto count = static_cast<double>(n);
    const double mean = sum / count;
    const double sd = n > 1 ? std::sqrt(std::max(0.0, square - count * mean * mean) / (count - 1)) : 0;
    return {{"mean", mean}, {"sd", sd}};
  }
};

Ordered settings_json(const ml::CandidateRow& row) {
  Ordered out = Ordered::object();
  for (const auto& [name, value] : row.settings) out[name] = value;
  return out;
}

Ordered candidate_json(const ml::TrainingOutcome& o, std::size_t index, bool bias) {
  const auto& row = o.candidates[index];
  Ordered out{{"name", row.name},
              {"method", ml::method_name(row.method)},
              {"settings", settings_json(row)},
              {"features", row.features},
              {"picked", row.picked},
              {"loss", row.loss},
              {"loss_sd", row.loss_sd}};
  if (bias) {
    out["mae_m"] = row.error.mae_m;
    out["mse_m2"] = row.error.mse_m2;
    out["worst_place_harm_m"] = row.worst_harm_m;
    out["mae_improvement"] = ml::improvement(o.candidates.front().error.mae_m, row.error.mae_m);
  } else {
    out.update(rates_json(row.confusion));
    out["brier"] = row.brier;
  }
  return out;
}

/// Mean and sd over the folds, as tables of chapter 6 have them.
Ordered cv_json(const ml::TrainingOutcome& o, std::size_t index, bool bias) {
  FoldSpread loss, accuracy, fpr, mae;
  for (const auto& fold : o.folds) {
    if (fold.candidate != index) continue;
    loss.add(fold.loss);
    mae.add(fold.mae_m);
    accuracy.add(fold.confusion.accuracy());
    // A fold of places without NLOS has no FPR.
    if (fold.confusion.fp + fold.confusion.tn > 0) fpr.add(fold.confusion.fpr());
  }
  if (bias) return {{"loss", loss.json()}, {"mae_m", mae.json()}};
  return {{"loss", loss.json()}, {"accuracy", accuracy.json()}, {"fpr", fpr.json()}};
}

Ordered test_json(const ml::Evaluation& e) {
  Ordered out{{"n", e.rows}};
  if (e.confusion) {
    out.update(rates_json(*e.confusion));
    out["brier"] = e.brier;
    out["log_loss"] = e.log_loss;
    out["roc_auc"] = e.roc_auc;
  }
  if (e.all) out["bias"] = bias_json(*e.all);
  if (e.los) out["bias_los"] = bias_json(*e.los);
  if (e.nlos) out["bias_nlos"] = bias_json(*e.nlos);
  if (e.nll) out["nll"] = *e.nll;
  Ordered places = Ordered::array();
  for (const auto& place : e.places) {
    Ordered entry{{"place", place.place}, {"n", place.rows}, {"accuracy", or_null(place.accuracy)}};
    entry["mae_raw_m"] = place.bias ? Ordered(place.bias->raw.mae_m) : Ordered(nullptr);
    entry["mae_m"] = place.bias ? Ordered(place.bias->corrected.mae_m) : Ordered(nullptr);
    places.push_back(std::move(entry));
  }
  out["places"] = std::move(places);
  return out;
}

Ordered split_json(const ml::SplitReport& s) {
  return {{"train", s.train_rows},
          {"train_settings", s.train_placements},
          {"train_places", s.train_places},
          {"test", s.test_rows},
          {"test_settings", s.test_placements},
          {"test_places", s.test_places},
          {"test_place_names", s.test_place_names},
          {"shared_settings", s.shared_placements},
          {"duplicate_rows", s.duplicate_rows},
          {"leak", s.leak}};
}

Ordered threshold_json(const ml::ThresholdReport& t) {
  return {{"threshold", t.threshold},
          {"max_fpr", or_null(t.max_fpr)},
          {"fpr", t.fpr},
          {"fpr_low95", t.fpr_low},
          {"fpr_high95", t.fpr_high},
          {"accuracy", t.accuracy},
          {"places", t.places},
          {"accuracy_at_half", t.accuracy_at_half}};
}

Ordered importance_json(const ml::TrainingOutcome& o) {
  Ordered out = Ordered::array();
  for (const auto& one : o.importance)
    out.push_back({{"feature", one.feature}, {"mean", one.mean}, {"sd", one.sd}});
  return out;
}

/// The best of each method, in the order they were tried.
Ordered results_json(const ml::TrainingOutcome& o, bool bias) {
  std::vector<std::size_t> best;
  for (std::size_t i = 0; i < o.candidates.size(); ++i) {
    const auto same = std::find_if(best.begin(), best.end(), [&](std::size_t k) {
      return o.candidates[k].method == o.candidates[i].method;
    });
    if (same == best.end())
      best.push_back(i);
    else if (o.candidates[i].picked ||
             (!o.candidates[*same].picked && o.candidates[i].loss < o.candidates[*same].loss))
      *same = i;
  }
  Ordered out = Ordered::array();
  for (const auto i : best) {
    const auto& row = o.candidates[i];
    Ordered entry{{"method", ml::method_name(row.method)},
                  {"name", row.name},
                  {"params", settings_json(row)},
                  {"features", row.features},
                  {"picked", row.picked},
                  {"cv", cv_json(o, i, bias)},
                  {"pooled", candidate_json(o, i, bias)},
                  {"test", row.picked && o.test ? test_json(*o.test) : Ordered(nullptr)}};
    out.push_back(std::move(entry));
  }
  return out;
}

Ordered folds_json(const ml::TrainingOutcome& o, bool bias) {
  Ordered out = Ordered::array();
  for (const auto& fold : o.folds) {
    Ordered entry{{"candidate", o.candidates[fold.candidate].name},
                  {"method", ml::method_name(o.candidates[fold.candidate].method)},
                  {"fold", fold.fold},
                  {"train", fold.train_rows},
                  {"test", fold.test_rows},
                  {"loss", fold.loss}};
    if (bias) {
      entry["mae_raw_m"] = fold.mae_raw_m;
      entry["mae_m"] = fold.mae_m;
    } else {
      entry.update(rates_json(fold.confusion));
    }
    out.push_back(std::move(entry));
  }
  return {{"items", std::move(out)}, {"places", o.fold_places}};
}

Ordered cdf_json(const ml::TrainingOutcome& o) {
  Ordered items = Ordered::array();
  const auto curve = [&](const char* name, const std::vector<ml::CdfPoint>& points) {
    if (points.empty()) return;
    Ordered list = Ordered::array();
    Ordered read = Ordered::object();
    for (const auto& p : points) list.push_back({{"value_m", p.value_m}, {"share", p.share}});
    for (const auto& [key, share] : {std::pair{"p50_m", 0.5}, {"p90_m", 0.9}, {"p95_m", 0.95}}) {
      const auto at = std::find_if(points.begin(), points.end(),
                                   [s = share](const ml::CdfPoint& p) { return p.share >= s - 1e-9; });
      read[key] = at == points.end() ? Ordered(nullptr) : Ordered(at->value_m);
    }
    items.push_back({{"method", name}, {"read", std::move(read)}, {"points", std::move(list)}});
  };
  curve("none", o.cdf_raw);
  // A mixture's manifest names its classifier as method; the curve is of the correction that was picked.
  const auto picked = std::find_if(o.candidates.begin(), o.candidates.end(),
                                   [](const ml::CandidateRow& row) { return row.picked; });
  curve((picked != o.candidates.end() ? picked->name : o.model.info.method).c_str(), o.cdf_corrected);
  return {{"items", std::move(items)}};
}

Ordered roc_json(const ml::TrainingOutcome& o) {
  Ordered points = Ordered::array();
  // A few hundred points draw the same curve as fifty thousand.
  const std::size_t step = std::max<std::size_t>(1, o.roc.size() / 400);
  for (std::size_t i = 0; i < o.roc.size(); ++i)
    if (i % step == 0 || i + 1 == o.roc.size())
      points.push_back({{"threshold", o.roc[i].threshold}, {"fpr", o.roc[i].fpr}, {"tpr", o.roc[i].tpr}});
  return {{"points", std::move(points)},
          {"auc", or_null(o.auc)},
          {"threshold", o.threshold ? threshold_json(*o.threshold) : Ordered(nullptr)}};
}

Ordered predictions_json(const ml::TrainingOutcome& o, const DatasetTable& table, const LearningRows& rows) {
  Ordered out = Ordered::array();
  for (const auto& p : o.predictions) {
    const auto& row = table.rows[rows.source[p.row]];
    Ordered entry{{"row", rows.source[p.row]},
                  {"campaign", row.campaign},
                  {"environment", row.environment},
                  {"setting", row.setting},
                  {"split", p.held_out ? "test" : "train"},
                  {"range_m", row.range_m()},
                  {"true_range_m", or_null(row.true_range_m)}};
    entry["los"] = p.los ? Ordered(*p.los) : Ordered(nullptr);
    entry["p_los"] = or_null(p.p_los);
    entry["bias_m"] = or_null(p.bias_m);
    entry["correction_m"] = or_null(p.correction_m);
    out.push_back(std::move(entry));
  }
  return out;
}

}  // namespace

nlohmann::ordered_json bias_json(const ml::BiasEvaluation& b) {
  return {{"n", b.raw.n},
          {"mae_raw_m", b.raw.mae_m},
          {"mae_m", b.corrected.mae_m},
          {"mse_raw_m2", b.raw.mse_m2},
          {"mse_m2", b.corrected.mse_m2},
          {"mae_improvement", ml::improvement(b.raw.mae_m, b.corrected.mae_m)},
          {"mse_improvement", ml::improvement(b.raw.mse_m2, b.corrected.mse_m2)}};
}

std::map<std::string, std::string> training_parts(const ml::TrainingOutcome& o, const DatasetTable& table,
                                                  const LearningRows& rows) {
  const auto& info = o.model.info;
  const bool bias = info.task != ml::Task::nlos_id;
  Ordered grid = Ordered::array(), dropped = Ordered::object(), metrics = Ordered::object();
  for (std::size_t i = 0; i < o.candidates.size(); ++i) grid.push_back(candidate_json(o, i, bias));
  for (const auto& [reason, n] : rows.dropped) dropped[reason] = n;
  for (const auto& [name, value] : info.metrics) metrics[name] = value;
  Ordered selection = Ordered::array();
  for (const auto& step : o.selection)
    selection.push_back({{"feature", step.feature}, {"loss", step.loss}, {"kept", step.kept}});
  Ordered confusion{{"cv", nullptr}, {"test", nullptr}, {"positive", "los"}};
  if (o.confusion) confusion["cv"] = rates_json(*o.confusion);
  if (o.test && o.test->confusion) confusion["test"] = rates_json(*o.test->confusion);
  confusion["threshold"] = o.model.classifier ? Ordered(o.model.classifier->threshold) : Ordered(nullptr);
  Ordered split = split_json(o.split);
  split["dropped"] = dropped;

  Ordered summary{{"method", info.method},
                  {"why", info.why},
                  {"features", info.features},
                  {"metrics", metrics},
                  {"results", results_json(o, bias)},
                  {"importance", importance_json(o)},
                  {"split", split},
                  {"threshold", o.threshold ? threshold_json(*o.threshold) : Ordered(nullptr)},
                  {"nll", or_null(o.nll)},
                  {"nll_constants", or_null(o.nll_constants)},
                  {"bias", o.bias ? bias_json(*o.bias) : Ordered(nullptr)},
                  {"test", o.test ? test_json(*o.test) : Ordered(nullptr)}};
  const auto text = [](const Ordered& json) { return to_wire(json); };
  return {{"summary", text(summary)},
          {"folds", text(folds_json(o, bias))},
          {"grid", text({{"items", grid}})},
          {"importance", text({{"items", importance_json(o)}})},
          {"selection", text({{"items", selection}})},
          {"confusion", text(confusion)},
          {"roc", text(roc_json(o))},
          {"cdf", text(cdf_json(o))},
          {"predictions", text(predictions_json(o, table, rows))}};
}

}  // namespace anchord::api
